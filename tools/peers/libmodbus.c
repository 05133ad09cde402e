/*
 * A server on libmodbus, as in its manual pages: modbus_mapping_new, modbus_receive, modbus_reply. The only
 * argument is the serial port; --version prints the library's version. Prints "ready" when it serves.
 */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include <modbus.h>

enum { UNIT = 1, BAUD = 19200, BITS = 2096, WORDS = 200 };

static int fail(const char *what)
{
    fprintf(stderr, "%s: %s\n", what, modbus_strerror(errno));
    return 1;
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        fprintf(stderr, "name a serial port\n");
        return 2;
    }
    if (strcmp(argv[1], "--version") == 0) {
        printf("%u.%u.%u\n", libmodbus_version_major, libmodbus_version_minor,
               libmodbus_version_micro);
        return 0;
    }
    modbus_t *line = modbus_new_rtu(argv[1], BAUD, 'N', 8, 2);
    if (line == NULL)
        return fail("modbus_new_rtu");
    modbus_mapping_t *points = modbus_mapping_new(BITS, BITS, WORDS, WORDS);
    if (points == NULL)
        return fail("modbus_mapping_new");
    if (modbus_set_slave(line, UNIT) != 0)
        return fail("modbus_set_slave");
    if (modbus_connect(line) != 0)
        return fail(argv[1]);
    puts("ready");
    fflush(stdout);
    for (;;) {
        uint8_t request[MODBUS_RTU_MAX_ADU_LENGTH];
        int length = modbus_receive(line, request);
        if (length > 0)
            modbus_reply(line, request, length, points);
        else if (length < 0 && (errno == EIO || errno == EBADF))
            return fail("modbus_receive");
        /* 0: a request for another unit. Any other error: a frame that is not valid, which is ignored. */
    }
}
