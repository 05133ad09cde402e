*** Settings ***
Documentation       Reading and writing the points of every module.
Resource            modio.resource


*** Test Cases ***
4DI Shows What Its Inputs Are Energised With
    Start Board    4di
    Request Gives    02 ${P}0 0004    02 01 00
    # Energised, an input pulls its line low.
    Execute Command    sysbus.gpioPortA OnGPIO 0 false
    Execute Command    sysbus.gpioPortA OnGPIO 3 false
    Run For    0.05
    Request Gives    02 ${P}0 0004    02 01 09
    Request Gives    01 ${P}3 0001    01 01 01
    Execute Command    sysbus.gpioPortA OnGPIO 0 true
    Run For    0.05
    Request Gives    02 ${P}0 0004    02 01 08

4DI Counts Pulses After The Debounce
    Start Board    4di
    FOR    ${_}    IN RANGE    3
        Execute Command    sysbus.gpioPortA OnGPIO 1 false
        Run For    0.05
        Execute Command    sysbus.gpioPortA OnGPIO 1 true
        Run For    0.05
    END
    # Two words a point, and the counter of channel 2.
    Request Gives    03 ${PULSES_2} 0002    03 04 0000 0003

4DO Drives What Is Written
    Start Board    4do
    Request Is Echoed    05 ${P}0 FF00
    Pin Should Be    ${ODR_A}    0    1
    Pin Should Be    ${ODR_A}    1    0
    Request Gives    01 ${P}0 0004    01 01 01
    Request Gives    0F ${P}0 0004 01 0A    0F ${P}0 0004
    Pin Should Be    ${ODR_A}    0    0
    Pin Should Be    ${ODR_A}    1    1
    Pin Should Be    ${ODR_A}    2    0
    Pin Should Be    ${ODR_A}    3    1
    Request Gives    02 ${P}0 0004    02 01 0A

2Relay Drives Its Coils And Shows Its Jumpers
    Start Board    2relay
    Request Gives    01 ${P}0 0004    01 01 00
    Request Is Echoed    05 ${P}2 FF00
    Pin Should Be    ${ODR_A}    2    1
    Pin Should Be    ${ODR_A}    3    0
    # The jumper of relay 2 says manual.
    Execute Command    sysbus.gpioPortA OnGPIO 1 false
    Run For    0.05
    Request Gives    01 ${P}0 0004    01 01 06
    # A jumper cannot be written.
    Request Gives    05 ${P}0 FF00    85 02

4AI Shows What Its Inputs Are
    Start Board    4ai
    Channel Converts To    0    0x0FFF
    Channel Converts To    2    0x0555
    Run For    1
    Request Gives    04 ${P}0 0004    04 08 0FFF 0000 0555 0000
    Request Gives    03 ${P}2 0001    03 02 0555

4AO Brings What Is Written To The DAC
    Start Board    4ao
    Request Gives    10 ${P}0 0004 08 0ABC 0000 0FFF 0123    10 ${P}0 0004
    Run For    0.05
    DAC Gives    0    0x0ABC
    DAC Gives    1    0x0000
    DAC Gives    2    0x0FFF
    DAC Gives    3    0x0123
    Request Is Echoed    06 ${P}3 0456
    Run For    0.05
    DAC Gives    3    0x0456
    Request Gives    03 ${P}0 0004    03 08 0ABC 0000 0FFF 0456

4AO Tells That Its DAC Does Not Answer And That It Does Again
    [Tags]    renode-only
    Start Board    4ao
    Request Gives    03 ${MODULE_STATE} 0001    03 02 0000
    Execute Command    sysbus WriteDoubleWord ${DAC_PLUGGED} 0
    Run For    2
    Request Gives    03 ${MODULE_STATE} 0001    03 02 0002
    Request Gives    06 ${P}0 0001    86 04
    Execute Command    sysbus WriteDoubleWord ${DAC_PLUGGED} 1
    Run For    2
    Request Gives    03 ${MODULE_STATE} 0001    03 02 0000
    Request Is Echoed    06 ${P}0 0001

2AI2AO Has Both
    Start Board    2ai2ao
    Channel Converts To    1    0x0FFF
    Request Gives    10 ${P}2 0002 04 0321 0ABC    10 ${P}2 0002
    Run For    1
    Request Gives    03 ${P}0 0004    03 08 0000 0FFF 0321 0ABC
    # Its outputs are channels C and D.
    DAC Gives    2    0x0321
    DAC Gives    3    0x0ABC

A Slot With Nothing In It Has No Points
    Start Board    none
    Request Gives    01 ${P}0 0001    81 02
    Request Gives    03 ${P}0 0001    83 02

Everything Of A Request Is Done Or Nothing
    Start Board    4ao
    Request Is Echoed    06 ${P}0 0111
    # 4096 is above what the DAC takes.
    Request Gives    10 ${P}0 0002 04 0222 1000    90 03
    Request Gives    03 ${P}0 0002    03 04 0111 0000

The Longest Frames Fit
    Start Board    4do
    # 123 registers; there are not so many.
    ${zeros}=    Evaluate    "0000" * 123
    Request Gives    10 0200 007B F6 ${zeros}    90 02
    Request Gives    03 0200 007D    83 02
    Unit Answers


*** Keywords ***
Channel Converts To
    [Documentation]    What the converter makes of an analog line, counted from 0.
    [Arguments]    ${channel}    ${code}
    ${address}=    Evaluate    hex(int($ADC_CODES, 0) + 4 * int($channel))
    Execute Command    sysbus WriteDoubleWord ${address} ${code}

DAC Gives
    [Documentation]    The code at an output of the MCP4728, counted from 0.
    [Arguments]    ${channel}    ${code}
    ${address}=    Evaluate    hex(int($DAC_CODES, 0) + 4 * int($channel))
    ${value}=    Read Word    ${address}
    Should Be Equal As Integers    ${value}    ${code}
