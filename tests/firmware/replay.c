/* Feeds the reference axis with stimuli from the standard input, one a line, and prints what it
 * says after each. Built with sanitizers by conftest.py; test_reference_axis.py compares. */
#include <inttypes.h>
#include <stdio.h>

#include "axis.h"

static void print(lax_axis_t *axis)
{
    uint16_t code;
    printf("%04x %" PRId64 " %" PRId64 " %" PRId64 " %d %d %02x", (unsigned)lax_statusword(axis),
           lax_servo_demand(axis), lax_servo_velocity(axis), axis->actual, lax_powered(axis),
           lax_brake_released(axis), (unsigned)lax_error_register(axis));
    while (lax_take_emergency(axis, &code)) {
        printf(" %04x", (unsigned)code);
    }
    putchar('\n');
}

int main(void)
{
    lax_axis_t axis;
    char line[128], kind;
    int64_t a, b, c, value;
    lax_init(&axis);
    while (fgets(line, sizeof line, stdin)) {
        a = b = c = 0;
        if (sscanf(line, "%c %" SCNd64 " %" SCNd64 " %" SCNd64, &kind, &a, &b, &c) < 1) {
            return 1;
        }
        switch (kind) {
        case 'w': printf("%08" PRIx32 " ", lax_write(&axis, (uint16_t)a, (uint8_t)b, c)); break;
        case 'r':
            value = 0;
            printf("%08" PRIx32 " ", lax_read(&axis, (uint16_t)a, (uint8_t)b, &value));
            printf("%" PRId64 " ", value);
            break;
        case 's': lax_setpoint(&axis, (uint16_t)a, (int32_t)b); break;
        case 'y': lax_sync(&axis); break;
        case 'h': lax_heartbeat(&axis); break;
        case 'o': lax_communication(&axis, a != 0); break;
        case 'f': lax_raise_fault(&axis, (uint16_t)a); break;
        case 't': lax_set_sto(&axis, a != 0); break;
        case 'i': lax_set_inputs(&axis, (uint32_t)a); break;
        case 'k': lax_tick(&axis, a, b); break;
        default: return 1;
        }
        print(&axis);
    }
    return 0;
}
