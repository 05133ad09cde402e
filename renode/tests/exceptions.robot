*** Settings ***
Documentation       Rejected requests, in the order of the checks: function, quantity and form,
...                 address, value, state. Also frames that get no answer.
Resource            modio.resource
Test Setup          Start Board    4do


*** Test Cases ***
Every Rejected Request Returns Its Exception
    [Template]    Request Gives
    # An unknown function.
    63                                  E3 01
    41 0000                             C1 01
    # Quantities, byte counts and values.
    01 ${P}0 0000                        81 03
    01 ${P}0 07D1                        81 03
    03 0200 007E                        83 03
    05 ${P}0 1234                        85 03
    0F ${P}0 0004 02 0F00                8F 03
    10 0104 0001 01 00                  90 03
    # The quantity is checked before the address.
    03 F000 0000                        83 03
    # Addresses: unknown, one past the end, wrapping, read-only.
    01 ${AFTER} 0001                        81 02
    01 ${P}0 0005                        81 02
    03 FFFF 0002                        83 02
    06 0200 0000                        86 02
    # A value out of range is checked before the lock.
    06 0104 FFFF                        86 03
    06 0100 0001                        86 03
    # The lock is closed.
    06 0104 000A                        86 06
    06 0108 0002                        86 06
    # An unknown sub-function, and an unknown object of the identification.
    08 0099 0000                        88 01
    2B 0E 04 55                         AB 02

A Rejected Request Changes Nothing
    Request Gives    0F ${P}0 0005 01 1F    8F 02
    Request Gives    05 ${P}0 1234    85 03
    Request Gives    01 ${P}0 0004    01 01 00
    Pin Should Be    ${ODR_A}    0    0

A Wrong CRC Gets Silence
    ${frame}=    Frame    1    05 ${P}0 FF00
    ${frame}=    Damaged    ${frame}
    Send And Wait    ${frame}
    Nothing Was Received
    Request Gives    01 ${P}0 0001    01 01 00

Noise Gets Silence And The Next Request Is Answered
    FOR    ${noise}    IN    00    FF FF    01 03 02
        Send And Wait    ${noise}
        Nothing Was Received
        Unit Answers
    END

A Truncated Frame Gets Silence And The Next Request Is Answered
    ${frame}=    Frame    1    03 0204 0001
    ${short}=    Part    ${frame}    0    5
    Send And Wait    ${short}
    Nothing Was Received
    Unit Answers

A Frame Of More Than 256 Bytes Is Dropped
    ${frame}=    Evaluate    "55" * 300
    Send And Wait    ${frame}
    Nothing Was Received
    Unit Answers
