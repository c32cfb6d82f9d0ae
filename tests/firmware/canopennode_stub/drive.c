/* A drive of the glue, the reference axis and the stub of its stack: configured and enabled as a
 * host does it, then moved by setpoints. Prints what test_porting.py looks at. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "glue.h"

static OD_entry_t entries[] = {
    {0x1016, 0, NULL}, {0x1400, 0, NULL}, {0x2010, 0, NULL}, {0x6007, 0, NULL}, {0x603F, 0, NULL},
    {0x6040, 0, NULL}, {0x6041, 0, NULL}, {0x605A, 0, NULL}, {0x605B, 0, NULL}, {0x605C, 0, NULL},
    {0x605D, 0, NULL}, {0x605E, 0, NULL}, {0x6060, 0, NULL}, {0x6061, 0, NULL}, {0x6064, 0, NULL},
    {0x6065, 0, NULL}, {0x6066, 0, NULL}, {0x606C, 0, NULL}, {0x607A, 0, NULL}, {0x607C, 0, NULL},
    {0x607D, 0, NULL}, {0x607F, 0, NULL}, {0x6085, 0, NULL}, {0x6098, 0, NULL}, {0x6099, 0, NULL},
    {0x609A, 0, NULL}, {0x60C2, 0, NULL}, {0x60F4, 0, NULL}, {0x60FD, 0, NULL}, {0x60FE, 0, NULL},
};

/* -- the stub ---------------------------------------------------------------------------------- */

OD_entry_t *OD_find(OD_t *od, uint16_t index)
{
    uint16_t i;
    for (i = 0; i < od->size; i++) {
        if (od->list[i].index == index) {
            return &od->list[i];
        }
    }
    return NULL;
}

ODR_t OD_extension_init(OD_entry_t *entry, OD_extension_t *extension)
{
    if (entry == NULL) {
        return ODR_IDX_NOT_EXIST;
    }
    entry->extension = extension;
    return ODR_OK;
}

ODR_t OD_readOriginal(OD_stream_t *stream, void *buf, OD_size_t count, OD_size_t *countRead)
{
    (void)stream;
    memset(buf, 0, count);
    *countRead = count;
    return ODR_OK;
}

ODR_t OD_get_u16(const OD_entry_t *entry, uint8_t sub, uint16_t *value, bool_t odOrig)
{
    (void)sub;
    (void)odOrig;
    *value = (uint16_t)entry->original;
    return ODR_OK;
}

ODR_t OD_get_u32(const OD_entry_t *entry, uint8_t sub, uint32_t *value, bool_t odOrig)
{
    (void)sub;
    (void)odOrig;
    *value = entry->original;
    return ODR_OK;
}

void OD_requestTPDO(uint8_t *flags, uint8_t sub) { flags[sub >> 3] &= (uint8_t)~(1u << (sub & 7)); }

CO_NMT_internalState_t CO_NMT_getInternalState(CO_NMT_t *nmt) { return nmt->operatingState; }

void CO_HBconsumer_initCallbackPre(CO_HBconsumer_t *consumer, void *object,
                                   void (*signal)(void *object))
{
    consumer->object = object;
    consumer->signal = signal;
}

void CO_error(CO_EM_t *em, bool_t set, uint8_t bit, uint16_t code, uint32_t info)
{
    (void)bit;
    (void)info;
    em->sent[em->count++ & 7] = set ? code : 0;
}

bool_t CO_process_SYNC(CO_t *co, uint32_t dt, uint32_t *timerNext)
{
    bool_t came = co->sync;
    (void)dt;
    (void)timerNext;
    co->sync = false;
    return came;
}

static ODR_t access(CO_t *co, bool write, uint16_t index, uint8_t sub, void *bytes, OD_size_t size)
{
    OD_stream_t stream;
    OD_size_t done;
    memset(&stream, 0, sizeof stream);
    stream.object = OD_find(co->od, index)->extension->object;
    stream.dataLength = size;
    stream.index = index;
    stream.subIndex = sub;
    return write ? OD_find(co->od, index)->extension->write(&stream, bytes, size, &done)
                 : OD_find(co->od, index)->extension->read(&stream, bytes, size, &done);
}

void CO_process_RPDO(CO_t *co, bool_t sync, uint32_t dt, uint32_t *timerNext)
{
    (void)dt;
    (void)timerNext;
    if (sync && co->rpdo) {
        co->rpdo = false;
        access(co, true, 0x6040, 0, co->rpdo_bytes, 2);
        access(co, true, 0x607A, 0, co->rpdo_bytes + 2, 4);
    }
}

void CO_process_TPDO(CO_t *co, bool_t sync, uint32_t dt, uint32_t *timerNext)
{
    uint8_t *flags = OD_find(co->od, 0x6061)->extension->flagsPDO;
    (void)dt;
    (void)timerNext;
    if (sync) {
        access(co, false, 0x6041, 0, co->tpdo_bytes, 2);
        access(co, false, 0x6064, 0, co->tpdo_bytes + 2, 4);
    }
    if (!(flags[0] & 1u)) {
        flags[0] |= 1u;
        co->tpdo2_count++;
    }
}

/* -- the host ---------------------------------------------------------------------------------- */

static ODR_t sdo_write(CO_t *co, uint16_t index, uint8_t sub, int64_t value, OD_size_t size)
{
    uint8_t bytes[4];
    OD_size_t i;
    for (i = 0; i < size; i++) {
        bytes[i] = (uint8_t)((uint64_t)value >> (8 * i));
    }
    return access(co, true, index, sub, bytes, size);
}

static int32_t position(const CO_t *co)
{
    const uint8_t *b = co->tpdo_bytes + 2;
    return (int32_t)((uint32_t)b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 |
                     (uint32_t)b[3] << 24);
}

/* One cycle of 2 ms: SYNC, then the setpoint, which acts at the next one. */
static void cycle(CO_t *co, lax_glue_t *glue, int64_t *encoder, uint16_t word, int32_t target)
{
    int i;
    co->sync = true;
    for (i = 0; i < 4; i++) {
        lax_glue_process(glue, co, 500, *encoder);
        *encoder = lax_servo_demand(&glue->axis) / LAX_FRACTION; /* an ideal servo */
        if (i == 0) {
            co->rpdo_bytes[0] = (uint8_t)word;
            co->rpdo_bytes[1] = (uint8_t)(word >> 8);
            co->rpdo_bytes[2] = (uint8_t)target;
            co->rpdo_bytes[3] = (uint8_t)((uint32_t)target >> 8);
            co->rpdo_bytes[4] = (uint8_t)((uint32_t)target >> 16);
            co->rpdo_bytes[5] = (uint8_t)((uint32_t)target >> 24);
            co->rpdo = true;
        }
    }
}

static void say(const CO_t *co, const char *when)
{
    printf("%s %02x%02x %" PRId32 "\n", when, (unsigned)co->tpdo_bytes[1],
           (unsigned)co->tpdo_bytes[0], position(co));
}

int main(void)
{
    OD_t od = {sizeof entries / sizeof *entries, entries};
    CO_CANmodule_t module = {0};
    CO_NMT_t nmt = {CO_NMT_PRE_OPERATIONAL};
    CO_EM_t em = {{0}, 0};
    CO_HBconsumer_t consumer = {NULL, NULL};
    CO_t co;
    lax_glue_t glue;
    int64_t encoder = -1000;
    int i;

    memset(&co, 0, sizeof co);
    co.CANmodule = &module;
    co.NMT = &nmt;
    co.em = &em;
    co.HBcons = &consumer;
    co.od = &od;
    memset(&glue, 0xA5, sizeof glue);
    od.size--;
    printf("lacks %04x\n", (unsigned)lax_glue_init(&glue, &co, &od));
    od.size++;
    printf("lacks %04x\n", (unsigned)lax_glue_init(&glue, &co, &od));

    OD_find(&od, 0x1016)->original = 127u << 16 | 250u; /* as the stack's SDO server keeps them */
    OD_find(&od, 0x1400)->original = 20;
    printf("mode %d\n", sdo_write(&co, 0x6060, 0, 8, 1));
    printf("limits %d %d\n", sdo_write(&co, 0x607D, 1, -90000, 4),
           sdo_write(&co, 0x607D, 2, 90000, 4));
    printf("wrong mode %d, wrong sub %d\n", sdo_write(&co, 0x6060, 0, 3, 1),
           sdo_write(&co, 0x607D, 3, 0, 4));
    nmt.operatingState = CO_NMT_OPERATIONAL;
    consumer.signal(consumer.object);
    for (i = 0; i < 3; i++) {
        cycle(&co, &glue, &encoder, i < 1 ? 0x6 : i < 2 ? 0x7 : 0xF, -1000);
    }
    cycle(&co, &glue, &encoder, 0xF, -1000);
    cycle(&co, &glue, &encoder, 0xF, -1000);
    say(&co, "enabled");
    for (i = 1; i <= 20; i++) {
        cycle(&co, &glue, &encoder, 0xF, -1000 + 100 * i);
    }
    say(&co, "moving");
    co.rpdo = false;
    for (i = 0; i < 400; i++) { /* the host is gone: 200 ms */
        lax_glue_process(&glue, &co, 500, encoder);
        encoder = lax_servo_demand(&glue.axis) / LAX_FRACTION;
    }
    co.sync = true;
    lax_glue_process(&glue, &co, 500, encoder);
    say(&co, "host gone");
    printf("emergencies");
    for (i = 0; i < em.count; i++) {
        printf(" %04x", (unsigned)em.sent[i]);
    }
    printf("\ntpdo2 %d, locks %d\n", co.tpdo2_count, module.locks);
    return 0;
}
