*** Settings ***
Documentation       Requests to unit 0 are executed and never answered.
Resource            modio.resource
Test Setup          Start Board    4do


*** Test Cases ***
A Broadcast Write Is Executed Without A Reply
    Request Gets Silence    05 ${P}1 FF00    0
    Pin Should Be    ${ODR_A}    1    1
    Request Gets Silence    0F ${P}0 0004 01 05    0
    Request Gives    01 ${P}0 0004    01 01 05

A Broadcast Read Gets Silence
    Request Gets Silence    01 ${P}0 0004    0
    Request Gets Silence    03 0200 0002    0
    Unit Answers

A Rejected Broadcast Gets Silence
    Request Gets Silence    63    0
    Request Gets Silence    05 ${P}0 1234    0
    Request Gets Silence    06 0104 000A    0
    Request Gives    01 ${P}0 0001    01 01 00

A Broadcast Is Counted As Unanswered
    Request Gives    08 000F 0000    08 000F 0000
    Request Gets Silence    05 ${P}0 FF00    0
    Request Gives    08 000F 0000    08 000F 0001
