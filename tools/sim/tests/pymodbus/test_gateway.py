"""Modbus TCP through the gateway: pymodbus and mbpoll access the unit that the masters on the line access."""

import concurrent.futures
import subprocess
import unittest

from pymodbus.client import ModbusTcpClient

from simulator import PATIENCE, OnSimulator
from test_mbpoll import MBPOLL

FIRST = 0x0010
NO_PATH, NO_ANSWER = 0x0A, 0x0B


class Gateway(OnSimulator):
    DIP = 17
    MODULE = "4do"

    def setUp(self):
        # The gateway is the master on the line.
        self.client = self.connect()

    def connect(self) -> ModbusTcpClient:
        host, _, port = self.simulator.gateway.rpartition(":")
        client = ModbusTcpClient(host, port=int(port), timeout=PATIENCE, retries=0)
        self.assertTrue(client.connect())
        self.addCleanup(client.close)
        return client

    def test_outputs_are_written_and_read(self):
        for pattern in ([True, False, True, True], [False, True, False, False]):
            answer = self.client.write_coils(FIRST, pattern, device_id=17)
            self.assertFalse(answer.isError(), answer)
            self.eventually(self.simulator.outputs, pattern)
            self.assertEqual(self.bits(self.client.read_coils(FIRST, count=4, device_id=17), 4), pattern)

    def test_missing_units_get_an_exception(self):
        self.refused(self.client.read_coils(FIRST, device_id=18), NO_ANSWER)
        self.refused(self.client.read_coils(FIRST, device_id=250), NO_PATH)
        self.simulator.power_off()
        self.refused(self.client.read_coils(FIRST, device_id=17), NO_ANSWER)
        self.simulator.power_on()
        self.simulator.wait(300)
        self.bits(self.client.read_coils(FIRST, device_id=17), 1)

    def test_clients_are_served_in_parallel(self):
        def reads(client):
            return [client.read_holding_registers(0x0200, count=2, device_id=17).registers
                    for _ in range(10)]

        clients = [self.connect() for _ in range(6)]
        with concurrent.futures.ThreadPoolExecutor(len(clients)) as threads:
            for registers in threads.map(reads, clients):
                self.assertEqual(registers, [[0x2383, 0x5860]] * 10)

    @unittest.skipUnless(MBPOLL, "mbpoll is not installed (Debian has it as a package)")
    def test_mbpoll_reads(self):
        host, _, port = self.simulator.gateway.rpartition(":")
        done = subprocess.run(
            [MBPOLL, "-m", "tcp", "-p", port, "-a", "17", "-0", "-r", "0x200", "-c", "2", "-t", "4:hex",
             "-1", "-o", "10.00", host], capture_output=True, text=True, timeout=PATIENCE, check=True)
        self.assertRegex(done.stdout, r"\[512\]:\s+0x2383\n\[513\]:\s+0x5860\n")
