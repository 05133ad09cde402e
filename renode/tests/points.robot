*** Settings ***
Documentation       Reads and writes of the points of every module.
Resource            modio.resource


*** Test Cases ***
4DI Reports Energised Inputs
    Start Board    4di
    Request Gives    02 ${P}0 0004    02 01 00
    # An energised input pulls its line low.
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
    # Two words per point; this is the counter of channel 2.
    Request Gives    03 ${PULSES_2} 0002    03 04 0000 0003

4DO Drives Its Outputs
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

2Relay Drives Its Coils And Reports Its Jumpers
    Start Board    2relay
    Request Gives    01 ${P}0 0004    01 01 00
    Request Is Echoed    05 ${P}2 FF00
    Pin Should Be    ${ODR_A}    2    1
    Pin Should Be    ${ODR_A}    3    0
    # Set the jumper of relay 2 to manual.
    Execute Command    sysbus.gpioPortA OnGPIO 1 false
    Run For    0.05
    Request Gives    01 ${P}0 0004    01 01 06
    # A jumper cannot be written.
    Request Gives    05 ${P}0 FF00    85 02

4AI Reports The Codes Of Its Inputs
    Start Board    4ai
    Channel Converts To    0    0x0FFF
    Channel Converts To    2    0x0555
    Run For    1
    Request Gives    04 ${P}0 0004    04 08 0FFF 0000 0555 0000
    Request Gives    03 ${P}2 0001    03 02 0555

4AO Writes Its Outputs To The DAC
    Start Board    4ao
    Request Gives    10 ${P}0 0004 08 0ABC 0000 0FFF 0123    10 ${P}0 0004
    Run For    0.05
    DAC Output Should Be    0    0x0ABC
    DAC Output Should Be    1    0x0000
    DAC Output Should Be    2    0x0FFF
    DAC Output Should Be    3    0x0123
    Request Is Echoed    06 ${P}3 0456
    Run For    0.05
    DAC Output Should Be    3    0x0456
    Request Gives    03 ${P}0 0004    03 08 0ABC 0000 0FFF 0456

4AO Reports When Its DAC Stops Answering And When It Answers Again
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

2AI2AO Has Inputs And Outputs
    Start Board    2ai2ao
    Channel Converts To    1    0x0FFF
    Request Gives    10 ${P}2 0002 04 0321 0ABC    10 ${P}2 0002
    Run For    1
    Request Gives    03 ${P}0 0004    03 08 0000 0FFF 0321 0ABC
    # Its outputs are channels C and D.
    DAC Output Should Be    2    0x0321
    DAC Output Should Be    3    0x0ABC
