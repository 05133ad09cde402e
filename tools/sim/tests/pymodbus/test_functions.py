"""The functions that do not read or write points, in RTU and in ASCII mode."""

from pymodbus import FramerType
from pymodbus.pdu.device import ModbusControlBlock
from pymodbus.pdu.file_message import FileRecord

from simulator import AsciiLine, OnSimulator

FIRST = 0x0010
KEY, COMM_TIMEOUT, COMMAND, FILTER = 0x0100, 0x0104, 0x0108, 0x0130
VERSION, STATUS, DESCRIPTION_CRC, UNIQUE_ID = 0x0202, 0x020A, 0x020F, 0x0220
CLEAR_FLAG = 5
TRIPPED, UNSAVED, UNLOCKED = 1, 8, 32


class Rtu(OnSimulator):
    """All of functions 07, 08, 0B, 0C, 11, 14, 16, 17 and 2B/0E that pymodbus supports."""

    def setUp(self):
        super().setUp()
        self.good(self.master.write_register(KEY, 0x5A17))
        self.good(self.master.write_registers(FILTER, [5] * 4))
        self.good(self.master.diag_restart_communication(True))

    def good(self, answer):
        self.assertFalse(answer.isError(), answer)
        return answer

    def registers(self, address, count):
        return self.good(self.master.read_holding_registers(address, count=count)).registers

    def test_07_and_08_02_return_the_status(self):
        status, = self.registers(STATUS, 1)
        self.assertTrue(status & UNLOCKED)
        self.assertEqual(self.good(self.master.read_exception_status()).status, status)
        self.assertEqual(self.good(self.master.diag_read_diagnostic_register()).message, status)

    def test_08_0a_clears_the_diagnostic_register_but_no_state(self):
        self.good(self.master.diag_clear_counters())
        self.assertEqual(self.good(self.master.diag_read_diagnostic_register()).message, 0)
        self.assertTrue(self.good(self.master.read_exception_status()).status & UNLOCKED)
        # A new event is reported again.
        self.good(self.master.write_register(FILTER, 6))
        status, = self.registers(STATUS, 1)
        self.assertTrue(status & UNSAVED)
        self.assertEqual(self.good(self.master.diag_read_diagnostic_register()).message, UNSAVED)

    def test_08_00_sends_the_data_back(self):
        # pymodbus expects an echo of two bytes over RTU for any data.
        for data in (b"\x00\x00", b"\xA5\x37", b"\xFF\x00"):
            self.assertEqual(self.good(self.master.diag_query_data(data)).message, data)

    def test_08_0a_to_14_count_and_clear(self):
        master = self.master
        self.good(master.diag_clear_counters())
        # Each of these requests is itself a message to this unit, and counted before it is answered.
        self.assertEqual(self.good(master.diag_read_bus_message_count()).message, 1)
        self.assertEqual(self.good(master.diag_read_device_message_count()).message, 2)
        for count in (master.diag_read_bus_comm_error_count, master.diag_read_bus_exception_error_count,
                      master.diag_read_device_no_response_count, master.diag_read_device_nak_count,
                      master.diag_read_device_busy_count, master.diag_read_bus_char_overrun_count):
            self.assertEqual(self.good(count()).message, 0, count.__name__)

        self.refused(master.read_coils(0, count=1), 2)
        self.good(master.read_exception_status())
        self.refused(master.write_registers(COMMAND, [0]), 3)
        # Two broadcasts. The read has no effect and gets no answer either.
        for ask in (lambda m: m.write_coil(FIRST, False, device_id=0, no_response_expected=True),
                    lambda m: m.read_coils(FIRST, count=1, device_id=0, no_response_expected=True),
                    lambda m: m.read_coils(FIRST, count=1, device_id=9, no_response_expected=True)):
            since = self.simulator.last_frame()
            ask(master)
            self.assertEqual(self.simulator.answer_to(since), b"")
        # The broadcast write is refused because an input cannot be written.
        self.assertEqual(self.good(master.diag_read_bus_exception_error_count()).message, 3)
        self.assertEqual(self.good(master.diag_read_device_no_response_count()).message, 2)
        self.assertEqual(self.good(master.diag_read_bus_message_count()).message, 8 + 3 + 3 + 3)
        self.assertEqual(self.good(master.diag_read_device_message_count()).message, 8 + 3 + 2 + 4)
        self.good(master.diag_clear_overrun_counter())
        self.assertEqual(self.good(master.diag_read_bus_char_overrun_count()).message, 0)
        self.assertEqual(self.good(master.diag_read_bus_exception_error_count()).message, 3)
        self.good(master.diag_clear_counters())
        self.assertEqual(self.good(master.diag_read_bus_exception_error_count()).message, 0)

    def test_a_frame_that_is_damaged_is_counted(self):
        self.good(self.master.diag_clear_counters())
        since = self.simulator.last_frame()
        self.master.socket.write(self.DAMAGED)
        self.assertEqual(self.simulator.answer_to(since), b"")
        self.assertEqual(self.good(self.master.diag_read_bus_comm_error_count()).message, 1)
        self.assertEqual(self.good(self.master.diag_read_bus_message_count()).message, 2)
        self.assertEqual(self.good(self.master.diag_get_comm_event_log()).events[:6],
                         [0x80, 0x40, 0x80, 0x40, 0x80, 0x82])

    # Function 07 of unit 1 with an invalid CRC.
    DAMAGED = bytes([1, 7, 0, 0])

    def test_busy_is_counted(self):
        # The power cycle closes the lock.
        self.simulator.power_cycle()
        self.simulator.wait(300)
        self.refused(self.master.write_register(FILTER, 6), 6)
        self.assertEqual(self.good(self.master.diag_read_device_busy_count()).message, 1)
        self.assertEqual(self.good(self.master.diag_read_device_nak_count()).message, 0)

    def test_unsupported_functions_and_addresses_are_refused(self):
        self.refused(self.master.diag_read_iop_overrun_count(), 1)
        self.refused(self.master.diag_getclear_modbus_response(), 1)
        self.refused(self.master.read_fifo_queue(address=FIRST), 1)
        record = FileRecord(file_number=2, record_data=b"\x00\x01")
        self.refused(self.master.read_file_record([record]), 2)
        self.refused(self.master.write_file_record([record]), 2)

    def test_14_reads_the_self_description(self):
        # pymodbus counts the bytes of a group.
        wanted = [
            FileRecord(file_number=1, record_number=0, record_length=4),
            FileRecord(file_number=1, record_number=2, record_length=2),
        ]
        head, document = self.good(self.master.read_file_record(wanted)).records
        crc = self.registers(DESCRIPTION_CRC, 1)[0].to_bytes(2, "big")
        self.assertEqual(head.record_data[2:], crc)
        # A CBOR array of three items, the first of which is the format version 1.
        self.assertEqual(document.record_data, b"\x83\x01")

    def test_0b_counts_successful_requests(self):
        before = self.good(self.master.diag_get_comm_event_counter())
        self.assertTrue(before.status, "the status must not be busy")
        for _ in range(3):
            self.registers(STATUS, 1)
        self.refused(self.master.read_coils(0, count=1), 2)
        after = self.good(self.master.diag_get_comm_event_counter())
        self.assertEqual(after.count - before.count, 3)

    def test_0c_lists_the_last_64_events(self):
        log = self.good(self.master.diag_get_comm_event_log())
        # The events: a restart, then this request. setUp has cleared the earlier ones.
        self.assertEqual((log.status, log.events), (True, [0x80, 0x00]))
        # The counts are those of function 0B, which counts neither itself nor this request.
        self.assertEqual((log.event_count, log.message_count), (0, 1))
        for _ in range(40):
            self.refused(self.master.read_coils(0, count=1), 2)
        log = self.good(self.master.diag_get_comm_event_log())
        self.assertEqual(log.events, [0x80] + [0x41, 0x80] * 31 + [0x41])
        self.assertEqual((log.event_count, log.message_count), (0, 42))
        self.registers(STATUS, 1)
        log = self.good(self.master.diag_get_comm_event_log())
        self.assertEqual(log.event_count, self.good(self.master.diag_get_comm_event_counter()).count)

    def test_listen_only_mode_ignores_requests_until_communication_restarts(self):
        self.good(self.master.diag_query_data(b"\x00\x00"))
        for ask in (lambda master: master.diag_force_listen_only(no_response_expected=False),
                    lambda master: master.write_register(FILTER, 77),
                    lambda master: master.diag_restart_communication(False)):
            self.silent(ask)
        self.assertEqual(self.registers(FILTER, 1), [5], "the write must have no effect")
        log = self.good(self.master.diag_get_comm_event_log()).events
        # Newest first: this request, the read, the restart; two requests received and executed in listen-only mode;
        # the start of that mode.
        self.assertEqual(log[:10], [0x80, 0x40, 0x80, 0x00, 0x60, 0xA0, 0x60, 0xA0, 0x04, 0x40])

    def test_11_returns_the_identification_and_the_run_indicator(self):
        answer = self.good(self.master.report_device_id())
        self.assertEqual((answer.identifier, answer.status), (b"\x01", True))
        self.good(self.master.write_register(COMM_TIMEOUT, 5))
        self.simulator.wait(700)
        self.assertFalse(self.good(self.master.report_device_id()).status, "outputs are at SAFE")
        self.assertTrue(self.good(self.master.read_exception_status()).status & TRIPPED)
        self.good(self.master.write_register(COMM_TIMEOUT, 0))
        self.good(self.master.write_register(COMMAND, CLEAR_FLAG))
        self.assertTrue(self.good(self.master.report_device_id()).status)

    def test_16_masks_a_register(self):
        def mask(address, and_mask, or_mask):
            return self.master.mask_write_register(address=address, and_mask=and_mask, or_mask=or_mask)

        value = 0x0125
        self.good(self.master.write_register(FILTER, value))
        for and_mask, or_mask in ((0xFFFF, 0), (0xFFF0, 0x000A), (0x00FF, 0x0300), (0, 0x0042)):
            answer = self.good(mask(FILTER, and_mask, or_mask))
            self.assertEqual((answer.address, answer.and_mask, answer.or_mask), (FILTER, and_mask, or_mask))
            value = value & and_mask | or_mask & ~and_mask
            self.assertEqual(self.registers(FILTER, 1), [value])
        self.refused(mask(FILTER, 0, 1001), 3)
        self.refused(mask(STATUS, 0, 0), 2)
        self.refused(mask(0x0400, 0, 0), 2)
        self.assertEqual(self.registers(FILTER, 1), [value])

    def test_17_writes_and_then_reads(self):
        def both(write, values, read, count):
            return self.master.readwrite_registers(
                write_address=write, values=values, read_address=read, read_count=count)

        answer = self.good(both(FILTER + 1, [11, 12], FILTER, 4))
        self.assertEqual(answer.registers, [5, 11, 12, 5], "the write comes first")
        self.assertEqual(self.registers(FILTER, 4), [5, 11, 12, 5])
        for write, values, read, count, code in (
                (FILTER, [1001], FILTER, 4, 3), (STATUS, [0], FILTER, 4, 2), (FILTER, [6], 0x0400, 1, 2),
                (FILTER, [6, 6], FIRST, 4, 2)):
            self.refused(both(write, values, read, count), code)
        self.assertEqual(self.registers(FILTER, 4), [5, 11, 12, 5], "a refused write changes nothing")

    def test_2b_returns_the_identification(self):
        version, patch = self.registers(VERSION, 2)
        serial = "".join(f"{word:04X}" for word in self.registers(UNIQUE_ID, 6)).encode()
        objects = {0: b"modio", 1: b"23835860", 2: f"{version >> 8}.{version & 0xFF}.{patch}".encode(),
                   4: b"modio-02", 5: b"LLD-ModbusIO-02", 6: b"Modbus I/O", 0x80: serial, 0x81: b"4di"}
        for code, there in ((1, range(3)), (2, range(7)), (3, (*range(7), 0x80, 0x81))):
            # A stream from an object that does not exist starts at the first object.
            for first in (0, 0x0A):
                answer = self.good(self.master.read_device_information(read_code=code, object_id=first))
                self.assertEqual((answer.conformity, answer.more_follows), (0x83, 0))
                self.assertEqual(list(answer.information), list(there))
                for number in set(there) & set(objects):
                    self.assertEqual(answer.information[number], objects[number])
        answer = self.good(self.master.read_device_information(read_code=3, object_id=0x80))
        self.assertEqual(answer.information, {0x80: serial, 0x81: b"4di"})
        for number, value in objects.items():
            answer = self.good(self.master.read_device_information(read_code=4, object_id=number))
            self.assertEqual(answer.information, {number: value})
        for number in (0x07, 0x7F, 0x82, 0xFF):
            self.refused(self.master.read_device_information(read_code=4, object_id=number), 2)
        self.refused(self.master.read_device_information(read_code=5), 3)


class Ascii(AsciiLine, Rtu):
    """The same functions in ASCII mode, and in addition points and settings."""

    DAMAGED = b":0107FF\r\n"

    def test_rtu_frames_get_no_answer(self):
        self.simulator.framer = FramerType.RTU
        try:
            self.silent(lambda master: master.read_coils(FIRST, count=4))
        finally:
            self.simulator.framer = FramerType.ASCII

    def test_08_00_sends_any_data_back(self):
        for length in (0, 1, 5, 248):
            data = bytes(range(length))
            self.assertEqual(self.good(self.master.diag_query_data(data)).message, data)

    def test_points_are_read(self):
        for pattern in ([True, False, False, True], [False, True, True, False]):
            for number, energised in enumerate(pattern, 1):
                self.simulator.set_channel(number, energised=energised)
            self.eventually(lambda: self.bits(self.master.read_coils(FIRST, count=4), 4), pattern)
            self.assertEqual(self.bits(self.master.read_discrete_inputs(FIRST, count=4), 4), pattern)
        self.refused(self.master.write_coil(FIRST, True), 2)
        self.refused(self.master.write_coils(FIRST, [True] * 4), 2)
        self.refused(self.master.read_input_registers(FIRST, count=1), 2)

    def test_settings_are_written(self):
        self.good(self.master.write_registers(FILTER, [1, 2, 3, 4]))
        self.good(self.master.write_register(FILTER, 9))
        self.assertEqual(self.registers(FILTER, 4), [9, 2, 3, 4])
        self.assertEqual(self.registers(0x01C0, 64), self.registers(0x01C0, 32) + self.registers(0x01E0, 32))

    def test_08_03_changes_the_end_of_a_frame_until_a_restart(self):
        try:
            # pymodbus puts the character at the given place: in the high byte.
            self.good(self.master.diag_change_ascii_input_delimeter(delimiter=ord("#") << 8))
            ModbusControlBlock().Delimiter = "#"
            self.assertEqual(self.registers(FILTER, 1), [5])
            self.good(self.master.diag_restart_communication(False))
        finally:
            ModbusControlBlock().Delimiter = "\n"
        self.assertEqual(self.registers(FILTER, 1), [5])
        for wrong in (ord(":") << 8, ord("\r") << 8, ord("A") << 8, 0x8000, 0x0023):
            self.refused(self.master.diag_change_ascii_input_delimeter(delimiter=wrong), 3)


class RtuDelimiter(OnSimulator):
    def test_08_03_is_only_in_ascii_mode(self):
        self.refused(self.master.diag_change_ascii_input_delimeter(delimiter=0x2300), 1)


class AnalogPoints(OnSimulator):
    """Functions 16 and 17 on points, with a module that has words to write."""

    MODULE = "4ao"

    def codes(self):
        return [channel.code for channel in self.simulator.state().channels]

    def test_16_and_17_write_outputs(self):
        answer = self.master.readwrite_registers(
            write_address=FIRST, values=[4095, 1, 0x0F0F, 0], read_address=FIRST, read_count=4)
        self.assertFalse(answer.isError(), answer)
        self.assertEqual(answer.registers, [4095, 1, 0x0F0F, 0])
        self.eventually(self.codes, [4095, 1, 0x0F0F, 0])
        answer = self.master.mask_write_register(address=FIRST + 2, and_mask=0x0FF0, or_mask=0x0005)
        self.assertFalse(answer.isError(), answer)
        self.eventually(self.codes, [4095, 1, 0x0F05, 0])
        self.refused(self.master.mask_write_register(address=FIRST, and_mask=0x0FFF, or_mask=0x1000), 3)
        self.assertEqual(self.codes(), [4095, 1, 0x0F05, 0])


class AnalogPointsInAscii(AsciiLine, AnalogPoints):
    """The same in ASCII mode."""
