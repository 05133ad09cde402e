*** Settings ***
Documentation       The end of a frame: 3.5 characters of silence, 4.01 ms at 9600 8N2. Renode has no
...                 input capture, so the start bit of the next character is not detected here; the gaps
...                 below differ from the limits by a character or more.
Resource            modio.resource
Test Setup          Start Board    4do


*** Test Cases ***
A Gap Below t1.5 Is Ignored
    Send In Two Parts    0.0010
    Wait For Bytes On Uart    ${REPLY}    timeout=0    matchStart=true
    Nothing Was Received

A Gap Between t1.5 And t3.5 Is Counted And The Frame Kept
    Send Bytes Every    0.003
    Expect    ${REPLY}
    # The counter of such gaps; this request has none.
    Request Gives    03 0238 0001    03 02 0007

A Gap Above t3.5 Ends The Frame
    Send In Two Parts    0.020
    Nothing Was Received
    Unit Answers

Bytes Separated By Long Silences Are No Frame
    Send Bytes Every    0.020
    Nothing Was Received
    Unit Answers

Requests Separated By A Silence Are All Answered
    FOR    ${_}    IN RANGE    10
        Unit Answers
    END

Two Requests Without A Silence Between Them Are Lost And The Next Is Answered
    Send    ${REQUEST}
    Send And Wait    ${REQUEST}
    Nothing Was Received
    Unit Answers

FRAME_GAP Changes The Silence After A Restart
    Unlock
    # 50 ms.
    Request Is Echoed    06 0106 01F4
    Request Is Echoed    06 0108 0001
    Request Is Echoed    06 0108 0002
    Run For    0.5
    Send In Two Parts    0.020
    Wait For Bytes On Uart    ${REPLY}    timeout=0    matchStart=true
    Nothing Was Received
    Send In Two Parts    0.100
    Nothing Was Received


*** Variables ***
# 03 0204 0001 reads the version of the register map.
${REQUEST}      01 03 02 04 00 01 C4 73
${REPLY}        01 03 02 00 02 39 85


*** Keywords ***
Send In Two Parts
    [Documentation]    Sends a request with one gap, in seconds. Where characters take their
    ...    time, the gap is 3.4 ms shorter, but not below 0.
    [Arguments]    ${gap}
    ${first}=    Part    ${REQUEST}    0    3
    ${second}=    Part    ${REQUEST}    3
    Send    ${first}
    Run For    ${gap}
    Send    ${second}
    Run For    0.2

Send Bytes Every
    [Documentation]    Sends a request whose characters begin this many seconds apart.
    [Arguments]    ${seconds}
    Write Char Delay    ${seconds}
    Send    ${REQUEST}
    Run For    0.5
    Write Char Delay    0
