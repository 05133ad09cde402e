*** Settings ***
Documentation       The four slots of the modio-08: points, settings, switch and store.
Resource            ../modio.resource


*** Test Cases ***
Four Modules Answer At Their Own Addresses
    Start Board    1=4di,2=4do,3=4ai,4=4ao
    # BOARD, the modules in force and their states.
    Request Gives    03 0205 0001    03 02 0002
    Request Gives    03 0210 0008    03 10 0001 0002 0004 0005 0000 0000 0000 0000
    Request Gives    03 0218 0008    03 10 0000 0000 0000 0000 0001 0001 0001 0001
    # An energised input pulls its line low.
    Execute Command    modio_input 1 3 false
    Request Gives    0F 0004 0004 01 09    0F 0004 0004
    Request Gives    10 000C 0004 08 0001 0014 0FA0 0FFF    10 000C 0004
    # Port 3, line 2.
    Channel Converts To    11    0x800
    Run For    0.5
    # One request for the bits of two slots, and one for the words of two.
    Request Gives    02 0000 0008    02 01 94
    Request Gives    04 0008 0008    04 10 0000 0800 0000 0000 0001 0014 0FA0 0FFF
    Pin Should Be    ${ODR_A}    4    1
    Pin Should Be    ${ODR_A}    5    0
    Pin Should Be    ${ODR_A}    7    1
    DAC Output Should Be    3    0x0FFF    slot=4
    # A span must not leave the slots with points of its kind.
    Request Gives    02 0000 0009    82 02
    Request Gives    0F 0003 0002 01 03    8F 02

Outputs Of Every Slot Drive Their Own Lines
    Start Board    1=4do,2=4do,3=4do,4=4do
    Request Gives    0F 0000 0010 02 21 84    0F 0000 0010
    Pin Should Be    ${ODR_A}    0    1
    Pin Should Be    ${ODR_A}    5    1
    Pin Should Be    ${ODR_C}    2    1
    Pin Should Be    ${ODR_C}    5    1
    Request Gives    0F 0000 0010 02 00 30    0F 0000 0010
    Pin Should Be    ${ODR_A}    0    0
    Pin Should Be    ${ODR_C}    5    0
    Pin Should Be    ${ODR_B}    0    1
    Pin Should Be    ${ODR_B}    1    1

Every Slot Has A DAC
    Start Board    1=4ao,2=4ao,3=4ao,4=4ao
    FOR    ${port}    IN RANGE    1    5
        ${address}=    Evaluate    '%04X' % (4 * ($port - 1))
        ${code}=    Evaluate    '%04X' % (0x111 * $port)
        Request Is Echoed    06 ${address} ${code}
        Run For    0.1
        DAC Output Should Be    0    0x${code}    slot=${port}
    END
    DAC Output Should Be    0    0x111    slot=1

Ports Without A Slot Accept No Module
    Start Board
    Unlock
    FOR    ${address}    IN    0114    0115    0116    0117
        Request Gives    06 ${address} 0001    86 03
        Request Is Echoed    06 ${address} 0000
    END
    Request Is Echoed    06 0113 0001
    Request Gives    03 0110 0008    03 10 0001 0000 0000 0001 0000 0000 0000 0000

The Switch Is Read From The Pins Of This Board
    Start Board    dip=165
    Unit Answers    165
    Request Gets Silence    03 0204 0001    1
