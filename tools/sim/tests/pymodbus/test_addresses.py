"""The DIP switch: which unit answers, and which does not."""

from simulator import OnSimulator

FIRST = 0x0010
UNITS = (1, 2, 17, 247, 248, 255)


class Unit1(OnSimulator):
    DIP = 1

    def test_only_its_own_address_is_answered(self):
        for unit in UNITS:
            with self.subTest(unit=unit):
                if unit == self.DIP:
                    self.bits(self.master.read_coils(FIRST, count=4, device_id=unit), 4)
                else:
                    self.silent(lambda master: master.read_coils(FIRST, count=4, device_id=unit))

    def test_a_broadcast_read_is_not_answered(self):
        self.silent(lambda master: master.read_coils(FIRST, count=4, device_id=0))


class Unit17(Unit1):
    DIP = 17


class Unit247(Unit1):
    DIP = 247


class Recovery(Unit1):
    """Recovery mode: 9600 8N2, unit 255, with any stored settings."""

    DIP = 255


class NoUnit(OnSimulator):
    """0 is not a unit address: the unit does not answer, and the fault LED blinks."""

    DIP = 0

    def test_no_unit_answers(self):
        for unit in (0, self.DIP, *UNITS):
            with self.subTest(unit=unit):
                self.silent(lambda master: master.read_coils(FIRST, count=4, device_id=unit))

    def test_the_fault_led_blinks(self):
        for wanted in (True, False, True):
            self.eventually(lambda: self.simulator.state().leds.fault, wanted)


class ReservedUnit(NoUnit):
    """248 is not a unit address either."""

    DIP = 248


class SwitchMoved(OnSimulator):
    def test_switch_is_read_at_the_next_power_on(self):
        self.simulator.set_dip(17)
        self.bits(self.master.read_coils(FIRST, count=4, device_id=1), 4)
        self.simulator.power_off()
        self.silent(lambda master: master.read_coils(FIRST, count=4, device_id=1))
        self.simulator.power_on()
        self.silent(lambda master: master.read_coils(FIRST, count=4, device_id=1))
        self.bits(self.master.read_coils(FIRST, count=4, device_id=17), 4)
