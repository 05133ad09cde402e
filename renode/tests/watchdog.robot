*** Settings ***
Documentation       The communication watchdog: outputs go to SAFE when the line is silent for too long.
Resource            modio.resource
Test Setup          Start Board    4do


*** Test Cases ***
A Watchdog That Is Off Never Trips
    Request Is Echoed    05 ${P}0 FF00
    Run For    5
    Pin Should Be    ${ODR_A}    0    1

Outputs Go To SAFE When The Line Is Silent
    Arm
    Request Is Echoed    05 ${P}0 FF00
    # 0.1 s of silence have already passed after the request.
    Run For    0.85
    Pin Should Be    ${ODR_A}    0    1
    Run For    0.10
    Pin Should Be    ${ODR_A}    0    0
    # Tripped, changed and not saved, unlocked.
    Request Gives    03 020A 0001    03 02 0029
    Request Gives    01 ${P}0 0004    01 01 00

Requests And Broadcasts Prevent A Trip
    Arm
    Request Is Echoed    05 ${P}0 FF00
    FOR    ${_}    IN RANGE    4
        Run For    0.6
        Unit Answers
        Run For    0.6
        Request Gets Silence    03 0204 0001    0
    END
    Pin Should Be    ${ODR_A}    0    1

Requests To Another Unit Do Not Prevent A Trip
    Arm
    Request Is Echoed    05 ${P}0 FF00
    FOR    ${_}    IN RANGE    2
        Run For    0.45
        Request Gets Silence    03 0204 0001    2
    END
    Pin Should Be    ${ODR_A}    0    0

Outputs Stay At SAFE Until Written And The Flag Stays Until Cleared
    Arm
    Request Is Echoed    05 ${P}0 FF00
    Run For    1.5
    Unit Answers
    Pin Should Be    ${ODR_A}    0    0
    Request Is Echoed    05 ${P}0 FF00
    Pin Should Be    ${ODR_A}    0    1
    Request Gives    03 020A 0001    03 02 0029
    Request Is Echoed    06 0108 0005
    Request Gives    03 020A 0001    03 02 0028

SAFE Can Switch An Output On
    Unlock
    # SAFE of the port's first point.
    Request Is Echoed    06 ${SAFE} 0001
    Request Is Echoed    06 0104 000A
    Run For    1.5
    Pin Should Be    ${ODR_A}    0    1

SAFE Can Hold An Output
    Unlock
    Request Is Echoed    06 ${SAFE} FFFF
    Request Is Echoed    06 0104 000A
    Request Is Echoed    05 ${P}0 FF00
    Run For    1.5
    Pin Should Be    ${ODR_A}    0    1
    Request Gives    03 020A 0001    03 02 0029


*** Keywords ***
Arm
    [Documentation]    Sets COMM_TIMEOUT to one second.
    Unlock
    Request Is Echoed    06 0104 000A
