*** Settings ***
Documentation       The configuration: the lock, and what is saved across a reset and a loss of power.
Resource            modio.resource
Test Setup          Start Board    4do


*** Test Cases ***
The Lock Opens By Its Key And Shows It
    Request Gives    03 0100 0001    03 02 0000
    Request Gives    06 0105 0005    86 06
    Unlock
    Request Gives    03 0100 0001    03 02 0001
    Request Is Echoed    06 0105 0005
    # Changed and not saved, unlocked.
    Request Gives    03 020A 0001    03 02 0028

What Is Saved Is There After A Restart
    Change The Response Delay
    Save
    Restart
    Request Gives    03 0105 0001    03 02 0019
    # Nothing is wrong or waiting, and the lock is closed.
    Request Gives    03 020A 0001    03 02 0000

A Restart Is Told By The Reset Flags
    Unlock
    Restart
    # Software, and the pin.
    Request Gives    03 0207 0001    03 02 0028

What Is Saved Is There After A Loss Of Power
    Change The Response Delay
    Save
    Cut The Power
    Request Gives    03 0105 0001    03 02 0019
    Request Gives    03 0207 0001    03 02 0030

What Is Not Saved Is Gone After A Restart
    Change The Response Delay
    Restart
    Request Gives    03 0105 0001    03 02 0000

Another Module Is In Force After The Restart
    Unlock
    # 4DI
    Request Is Echoed    06 ${MODULE} 0001
    Request Is Echoed    05 ${P}0 0000
    Save
    Restart
    Request Gives    03 ${IN_FORCE} 0001    03 02 0001
    # An input cannot be written.
    Request Gives    05 ${P}0 0000    85 02

Saves Go On When A Page Is Full
    # A record takes some 25 bytes of a page's 1024 or 2048.
    Unlock
    FOR    ${n}    IN RANGE    1    ${{$SAVES + 1}}
        ${value}=    Evaluate    '%04X' % $n
        # LORA_ADDRESS, which changes nothing else.
        Request Is Echoed    06 0141 ${value}
        Request Is Echoed    06 0108 0001
    END
    Restart
    Request Gives    03 0141 0001    03 02 ${SAVES_WORD}

Defaults Come Back
    Change The Response Delay
    Request Is Echoed    06 0108 0003
    Request Gives    03 0105 0001    03 02 0000


*** Keywords ***
Change The Response Delay
    Unlock
    # 25 ms
    Request Is Echoed    06 0105 0019

Save
    Request Is Echoed    06 0108 0001
    Run For    0.2

Restart
    Request Is Echoed    06 0108 0002
    Run For    0.5
