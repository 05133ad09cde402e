*** Settings ***
Documentation       The configuration: the lock, and saved settings after a reset and a loss of power.
Resource            modio.resource
Test Setup          Start Board    4do


*** Test Cases ***
The Key Opens The Lock And KEY Reads 1
    Request Gives    03 0100 0001    03 02 0000
    Request Gives    06 0105 0005    86 06
    Unlock
    Request Gives    03 0100 0001    03 02 0001
    Request Is Echoed    06 0105 0005
    # Changed and not saved, unlocked.
    Request Gives    03 020A 0001    03 02 0028

Saved Settings Are In Force After A Restart
    Change The Response Delay
    Save
    Restart
    Request Gives    03 0105 0001    03 02 0019
    # No fault, nothing unsaved, and the lock is closed.
    Request Gives    03 020A 0001    03 02 0000

A Restart Is Reported In The Reset Flags
    Unlock
    Restart
    # Software and the pin.
    Request Gives    03 0207 0001    03 02 0028

Saved Settings Are In Force After A Loss Of Power
    Change The Response Delay
    Save
    Cut The Power
    Request Gives    03 0105 0001    03 02 0019
    Request Gives    03 0207 0001    03 02 0030

Unsaved Settings Are Lost After A Restart
    Change The Response Delay
    Restart
    Request Gives    03 0105 0001    03 02 0000

A New Module Takes Effect After The Restart
    Unlock
    # 4DI
    Request Is Echoed    06 ${MODULE} 0001
    Request Is Echoed    05 ${P}0 0000
    Save
    Restart
    Request Gives    03 ${IN_FORCE} 0001    03 02 0001
    # An input cannot be written.
    Request Gives    05 ${P}0 0000    85 02

Saves Continue When A Page Is Full
    # A record takes about 280 bytes of the 1024 or 2048 of a page. Twenty saves are possible together.
    Unlock
    ${values}=    Evaluate    '0064' * 32
    Request Gives    10 0120 0020 40 ${values}    10 0120 0020
    ${values}=    Evaluate    '07D0' * 32
    Request Gives    10 0160 0020 40 ${values}    10 0160 0020
    FOR    ${n}    IN RANGE    1    ${{$SAVES + 1}}
        ${value}=    Evaluate    '%04X' % $n
        # LORA_ADDRESS, which has no other effect.
        Request Is Echoed    06 0141 ${value}
        Request Is Echoed    06 0108 0001
    END
    Restart
    Request Gives    03 0141 0001    03 02 ${SAVES_WORD}

Load Defaults Sets Every Setting To Its Default
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
