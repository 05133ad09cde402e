*** Settings ***
Documentation       SW01: the unit's address, read once at power-on.
Resource            modio.resource


*** Test Cases ***
Every Position Of The Switch Has Its Weight
    [Template]    Address Is The Switch
    1
    2
    4
    8
    16
    32
    64
    128
    247

Another Unit's Request Gets Silence
    Start Board    dip=17
    Unit Answers    17
    Request Gets Silence    03 0204 0001    1
    Request Gets Silence    03 0204 0001    18
    Unit Answers    17

255 Is The Loader Mode
    Start Board    dip=255
    Unit Answers    255
    Request Gives    03 0206 0001    03 02 00FF    255

A Position That Is No Address Makes The Unit Silent And Its Fault LED Blink
    [Template]    Is Silent And Blinks
    0
    248
    254

A Switch That Moves Counts At The Next Power-On Only
    Start Board    dip=5
    # The pins of a running board: the firmware does not look at them again.
    Execute Command    modio_inputs 9
    Unit Answers    5
    Request Gets Silence    03 0204 0001    9
    # The switch: every reset drives its position onto the pins.
    Execute Command    $dip=9
    Unit Answers    5
    Cut The Power
    Unit Answers    9
    Request Gets Silence    03 0204 0001    5
    Request Gives    03 0206 0001    03 02 0009    9


*** Keywords ***
Address Is The Switch
    [Arguments]    ${dip}
    Start Board    dip=${dip}
    Unit Answers    ${dip}
    ${hex}=    Evaluate    '%04X' % int($dip)
    Request Gives    03 0206 0001    03 02 ${hex}    ${dip}

Is Silent And Blinks
    [Arguments]    ${dip}
    Start Board    dip=${dip}
    FOR    ${unit}    IN    ${dip}    1    255
        Request Gets Silence    03 0204 0001    ${unit}
    END
    @{seen}=    Create List
    FOR    ${_}    IN RANGE    20
        Run For    0.1
        ${pins}=    Read Word    ${ODR_B}
        ${lit}=    Evaluate    $pins >> 9 & 1
        Append To List    ${seen}    ${lit}
    END
    Should Contain    ${seen}    ${1}
    Should Contain    ${seen}    ${0}
