"""pymodbus, an independent Modbus master: each function that pymodbus has, once in RTU and once in ASCII mode, and a
read over Modbus TCP and over the air. What the unit must answer beyond that is tested by the conformance suite."""

import pathlib
import tempfile
import unittest

from pymodbus import FramerType
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.pdu.device import ModbusControlBlock
from pymodbus.pdu.file_message import FileRecord

from simulator import PATIENCE, OnSimulator, Simulator

FIRST = 0x0010
KEY, FILTER, STATUS, DESCRIPTION_CRC = 0x0100, 0x0130, 0x020A, 0x020F
UNLOCKED = 32
# Virtual milliseconds for the radio module's set-up.
SET_UP_MS = 2500


class Rtu(OnSimulator):
    MODULE = "4do"

    def good(self, answer):
        """Returns an answer, which must not be an exception."""
        self.assertFalse(answer.isError(), answer)
        return answer

    def registers(self, address, count):
        return self.good(self.master.read_holding_registers(address, count=count)).registers

    def test_01_02_05_and_0f_access_outputs(self):
        self.good(self.master.write_coils(FIRST, [True, False, True, True]))
        self.good(self.master.write_coil(FIRST + 2, False))
        wanted = [True, False, False, True]
        self.eventually(self.simulator.outputs, wanted)
        for read in (self.master.read_coils, self.master.read_discrete_inputs):
            self.assertEqual(self.good(read(FIRST, count=4)).bits[:4], wanted)
        self.assertEqual(self.master.write_coils(FIRST + 1, [True] * 4).exception_code, 2)

    def test_03_04_06_10_16_and_17_access_registers(self):
        self.good(self.master.write_register(KEY, 0x5A17))
        self.good(self.master.write_registers(FILTER, [1, 2, 3, 0x0125]))
        mask = self.good(self.master.mask_write_register(address=FILTER + 3, and_mask=0x00FF, or_mask=0x0300))
        self.assertEqual((mask.and_mask, mask.or_mask), (0x00FF, 0x0300))
        both = self.good(self.master.readwrite_registers(
            write_address=FILTER + 1, values=[11], read_address=FILTER, read_count=4))
        self.assertEqual(both.registers, [1, 11, 3, 0x0325])
        self.assertEqual(self.good(self.master.read_input_registers(FILTER, count=4)).registers, both.registers)
        self.assertEqual(len(self.registers(0x0160, 125)), 125)

    def test_07_08_0b_0c_and_11_report_the_state(self):
        master = self.master
        self.good(master.write_register(KEY, 0x5A17))
        self.assertTrue(self.good(master.read_exception_status()).status & UNLOCKED)
        self.good(master.diag_restart_communication(True))
        self.assertEqual(self.good(master.diag_query_data(b"\xA5\x37")).message, b"\xA5\x37")
        self.assertTrue(self.good(master.diag_read_diagnostic_register()).message & UNLOCKED)
        self.good(master.diag_clear_counters())
        # A request is counted before it is answered.
        self.assertEqual(self.good(master.diag_read_bus_message_count()).message, 1)
        self.assertEqual(self.good(master.diag_read_device_message_count()).message, 2)
        for count in (master.diag_read_bus_comm_error_count, master.diag_read_bus_exception_error_count,
                      master.diag_read_device_no_response_count, master.diag_read_device_nak_count,
                      master.diag_read_device_busy_count, master.diag_read_bus_char_overrun_count):
            self.assertEqual(self.good(count()).message, 0, count.__name__)
        self.good(master.diag_clear_overrun_counter())
        self.assertTrue(self.good(master.diag_get_comm_event_counter()).status, "the status must not be busy")
        self.assertEqual(self.good(master.diag_get_comm_event_log()).events[:2], [0x80, 0x40])
        identity = self.good(master.report_device_id())
        self.assertEqual((identity.identifier, identity.status), (b"\x01", True))

    def test_listen_only_mode_ends_with_a_restart(self):
        for ask in (lambda master: master.diag_force_listen_only(no_response_expected=False),
                    lambda master: master.diag_restart_communication(False)):
            self.silent(ask)
        self.registers(STATUS, 1)

    def test_14_reads_the_self_description(self):
        # pymodbus counts the bytes of a group.
        wanted = [
            FileRecord(file_number=1, record_number=0, record_length=4),
            FileRecord(file_number=1, record_number=2, record_length=2),
        ]
        head, document = self.good(self.master.read_file_record(wanted)).records
        self.assertEqual(head.record_data[2:], self.registers(DESCRIPTION_CRC, 1)[0].to_bytes(2, "big"))
        # A CBOR array of three items, the first of which is the format version 1.
        self.assertEqual(document.record_data, b"\x83\x01")

    def test_2b_returns_the_identification(self):
        for code, last in ((1, 2), (2, 6), (3, 0x81)):
            answer = self.good(self.master.read_device_information(read_code=code, object_id=0))
            self.assertEqual((answer.information[0], max(answer.information)), (b"modio", last))
        answer = self.good(self.master.read_device_information(read_code=4, object_id=0x81))
        self.assertEqual(answer.information, {0x81: b"4do"})

    def test_modbus_tcp_reads_through_the_gateway(self):
        host, _, port = self.simulator.gateway.rpartition(":")
        client = ModbusTcpClient(host, port=int(port), timeout=PATIENCE, retries=0)
        self.assertTrue(client.connect())
        self.addCleanup(client.close)
        identity = self.good(client.read_holding_registers(0x0200, count=2))
        self.assertEqual(identity.registers, [0x2383, 0x5860])


class Ascii(Rtu):
    """The same in ASCII mode, at 115200 bit/s."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        master = cls.simulator.master()
        # KEY; BAUD; MODE; COMMAND: save, restart.
        for address, value in ((KEY, 0x5A17), (0x0101, 1152), (0x0103, 1), (0x0108, 1), (0x0108, 2)):
            answer = master.write_register(address, value)
            assert not answer.isError(), answer
        master.close()
        cls.simulator.wait(300)
        assert cls.simulator.state().line.baud == 115200
        cls.simulator.framer = FramerType.ASCII

    def test_08_03_changes_the_end_of_a_frame_until_a_restart(self):
        try:
            # pymodbus puts the character at the given place: in the high byte.
            self.good(self.master.diag_change_ascii_input_delimeter(delimiter=ord("#") << 8))
            ModbusControlBlock().Delimiter = "#"
            self.good(self.master.diag_restart_communication(False))
        finally:
            ModbusControlBlock().Delimiter = "\n"
        self.registers(STATUS, 1)


class OverTheAir(unittest.TestCase):
    def test_reply_of_several_packets_is_read(self):
        with tempfile.TemporaryDirectory() as directory:
            simulator = Simulator.of(module="4do", lora=pathlib.Path(directory) / "gateway")
            self.addCleanup(simulator.end_well)
            simulator.wait(SET_UP_MS)
            radio = ModbusSerialClient(simulator.lora, baudrate=9600, timeout=PATIENCE, retries=0)
            self.assertTrue(radio.connect())
            self.addCleanup(radio.close)
            line = simulator.master()
            self.addCleanup(line.close)
            read = [master.read_holding_registers(0x01C0, count=64).registers for master in (radio, line)]
            self.assertEqual((len(read[0]), read[0]), (64, read[1]))
