*** Settings ***
Documentation       SW01: the unit's address, read once at power-on.
Resource            modio.resource


*** Test Cases ***
Every Switch Position Selects Its Address
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

Position 255 Selects Recovery Mode
    Start Board    dip=255
    Unit Answers    255
    Request Gives    03 0206 0001    03 02 00FF    255

An Invalid Address Silences The Unit And Blinks The Fault LED
    [Template]    Is Silent And Blinks
    0
    248

Position 254 Selects Recovery Mode Behind A Loader
    Start Board    dip=254
    IF    "${PLAIN}" == "true"
        Is Silent And Blinks    254
    ELSE
        Unit Answers    255
    END

A New Switch Position Takes Effect At The Next Power-On
    Start Board    dip=5
    # Change the pins of a running board: the firmware does not read them again.
    Execute Command    modio_inputs 9
    Unit Answers    5
    Request Gets Silence    03 0204 0001    9
    # Move the switch: every reset drives its position onto the pins.
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
