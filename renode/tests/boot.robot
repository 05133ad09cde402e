*** Settings ***
Documentation       Behaviour of the unit at power-on.
Resource            modio.resource
Test Setup          Start Board


*** Test Cases ***
Answers Half A Second After Power-On
    Unit Answers

Reports Its Identity
    # Product code and board.
    Request Gives    03 0200 0002    03 04 2383 5860
    Request Gives    03 0205 0001    03 02 ${BOARD_CODE}

Reports The Unique Identity
    # Six half-words at 0x1FFFF7E8, as in the board's .repl file.
    Request Gives    03 0220 0006    03 0C 1100 3322 5544 7766 1908 3B2A

Reports A Power-On In The Reset Flags
    # Power-on and the pin; no fault.
    Request Gives    03 0207 0001    03 02 0030
    Request Gives    03 020A 0001    03 02 0000

Reports Its Uptime
    Run For    2
    # 2.5 s plus the time of a request.
    Request Gives    03 0208 0002    03 04 0000 0002

Sends Nothing While It Starts
    Nothing Was Received

Writes A Log
    ${log}=    Read Log
    Should Contain    ${log}    on ${BOARD_NAME}, 9600 8N2
    Should Contain    ${log}    reset: power-on
    Should Contain    ${log}    unit address 1
    Should Contain    ${log}    slot ${PORT}: 4di

Starts Without A Crystal
    Execute Command    sysbus WriteDoubleWord ${CRYSTAL} 0
    Cut The Power
    Unit Answers
    ${log}=    Read Log
    Should Contain    ${log}    the crystal did not start
