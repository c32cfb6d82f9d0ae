#include "glue.h"

#include "linear_axis.h"

#define FAULT_BIT CO_EM_MANUFACTURER_START /* of the stack's error status bits */

/* For which the axis answers. 0x1016 and 0x1400 it needs to know, but they are the stack's. */
static const uint16_t indices[LAX_GLUE_OBJECTS] = {
    0x2010, 0x6007, 0x603F, 0x6040, 0x6041, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E,
    0x6060, 0x6061, 0x6064, 0x6065, 0x6066, 0x606C, 0x607A, 0x607C, 0x607D, 0x607F,
    0x6085, 0x6098, 0x6099, 0x609A, 0x60C2, 0x60F4, 0x60FD, 0x60FE,
};

static bool is_signed(uint32_t key)
{
    switch (key) {
    case LAX_ABORT_CONNECTION_OPTION_CODE:
    case LAX_QUICK_STOP_OPTION_CODE:
    case LAX_SHUTDOWN_OPTION_CODE:
    case LAX_DISABLE_OPERATION_OPTION_CODE:
    case LAX_HALT_OPTION_CODE:
    case LAX_FAULT_REACTION_OPTION_CODE:
    case LAX_MODES_OF_OPERATION:
    case LAX_TARGET_POSITION:
    case LAX_HOME_OFFSET:
    case LAX_SOFTWARE_POSITION_LIMIT_MIN_POSITION_LIMIT:
    case LAX_SOFTWARE_POSITION_LIMIT_MAX_POSITION_LIMIT:
    case LAX_HOMING_METHOD:
    case LAX_INTERPOLATION_TIME_PERIOD_INTERPOLATION_TIME_INDEX:
        return true;
    default:
        return false;
    }
}

/* -- objects ----------------------------------------------------------------------------------- */

static int64_t unpack(uint32_t key, const uint8_t *bytes, OD_size_t count)
{
    uint64_t word = 0;
    OD_size_t i;
    for (i = 0; i < count; i++) {
        word |= (uint64_t)bytes[i] << (8 * i);
    }
    if (is_signed(key) && (word >> (8 * count - 1)) != 0) {
        return (int64_t)word - (INT64_C(1) << (8 * count));
    }
    return (int64_t)word;
}

static ODR_t answer(uint32_t abort)
{
    switch (abort) {
    case 0: return ODR_OK;
    case LAX_OUT_OF_RANGE: return ODR_INVALID_VALUE;
    case LAX_TOO_HIGH: return ODR_VALUE_HIGH;
    case LAX_TOO_LOW: return ODR_VALUE_LOW;
    case LAX_WRONG_STATE: return ODR_DATA_DEV_STATE;
    default: return ODR_SUB_NOT_EXIST;
    }
}

static ODR_t read_axis(OD_stream_t *stream, void *buf, OD_size_t count, OD_size_t *countRead)
{
    const lax_glue_t *glue = (const lax_glue_t *)stream->object;
    uint8_t *bytes = (uint8_t *)buf;
    int64_t value;
    OD_size_t i;
    if (lax_read(&glue->axis, stream->index, stream->subIndex, &value) != 0) {
        return OD_readOriginal(stream, buf, count, countRead); /* the number of sub-indices */
    }
    if (count < stream->dataLength) {
        return ODR_DEV_INCOMPAT;
    }
    for (i = 0; i < stream->dataLength; i++) {
        bytes[i] = (uint8_t)((uint64_t)value >> (8 * i));
    }
    *countRead = stream->dataLength;
    return ODR_OK;
}

static ODR_t write_axis(OD_stream_t *stream, const void *buf, OD_size_t count,
                        OD_size_t *countWritten)
{
    lax_glue_t *glue = (lax_glue_t *)stream->object;
    uint32_t key = LAX_KEY(stream->index, stream->subIndex);
    int64_t value;
    if (count != stream->dataLength || count == 0 || count > 4) {
        return ODR_TYPE_MISMATCH;
    }
    value = unpack(key, (const uint8_t *)buf, count);
    *countWritten = count;
    if (glue->within_rpdo && key == LAX_CONTROLWORD) { /* it acts with its target, not before */
        glue->controlword = (uint16_t)value;
        glue->has_controlword = true;
        return ODR_OK;
    }
    if (glue->within_rpdo && key == LAX_TARGET_POSITION) {
        glue->target = (int32_t)value;
        glue->has_target = true;
        return ODR_OK;
    }
    return answer(lax_write(&glue->axis, stream->index, stream->subIndex, value));
}

/* -- from the stack to the axis ---------------------------------------------------------------- */

static void hear_host(void *object) { ((lax_glue_t *)object)->heard_host = true; }

/* Take over an object that the stack keeps, once it has another value. */
static void follow(lax_glue_t *glue, uint16_t index, uint8_t sub, int64_t value)
{
    int64_t known;
    if (lax_read(&glue->axis, index, sub, &known) == 0 && known != value) {
        (void)lax_write(&glue->axis, index, sub, value);
    }
}

static void follow_stack(lax_glue_t *glue, CO_t *co)
{
    uint32_t consumer;
    uint16_t timer;
    if (OD_get_u32(glue->heartbeat_consumer, 1, &consumer, true) == ODR_OK) {
        follow(glue, 0x1016, 1, consumer);
    }
    if (OD_get_u16(glue->rpdo1, 5, &timer, true) == ODR_OK) {
        follow(glue, 0x1400, 5, timer);
    }
    lax_communication(&glue->axis, CO_NMT_getInternalState(co->NMT) == CO_NMT_OPERATIONAL);
    if (glue->heard_host) {
        glue->heard_host = false;
        lax_heartbeat(&glue->axis);
    }
}

/* Let RPDOs be unpacked, and give the axis the setpoint that was among them. */
static void take_setpoint(lax_glue_t *glue, CO_t *co, bool_t sync, uint32_t dt)
{
    glue->has_controlword = glue->has_target = false;
    glue->within_rpdo = true;
    CO_process_RPDO(co, sync, dt, NULL);
    glue->within_rpdo = false;
    if (glue->has_controlword && glue->has_target) {
        lax_setpoint(&glue->axis, glue->controlword, glue->target);
    } else if (glue->has_controlword) { /* a mapping of the host's own */
        (void)lax_write(&glue->axis, 0x6040, 0, glue->controlword);
    } else if (glue->has_target) {
        (void)lax_write(&glue->axis, 0x607A, 0, glue->target);
    }
}

/* -- from the axis to the stack ---------------------------------------------------------------- */

static OD_extension_t *extension_of(lax_glue_t *glue, uint16_t index)
{
    unsigned i = 0;
    while (indices[i] != index) {
        i++;
    }
    return &glue->extensions[i];
}

/* Ask for TPDO2 where what it carries has changed. */
static void tell_changes(lax_glue_t *glue)
{
    int64_t inputs, mode;
    (void)lax_read(&glue->axis, 0x60FD, 0, &inputs);
    (void)lax_read(&glue->axis, 0x6061, 0, &mode);
    if ((uint32_t)inputs != glue->inputs) {
        glue->inputs = (uint32_t)inputs;
        OD_requestTPDO(extension_of(glue, 0x60FD)->flagsPDO, 0);
    }
    if (mode != glue->mode) {
        glue->mode = mode;
        OD_requestTPDO(extension_of(glue, 0x6061)->flagsPDO, 0);
    }
}

static void tell_emergencies(lax_glue_t *glue, CO_t *co)
{
    uint16_t code;
    while (lax_take_emergency(&glue->axis, &code)) {
        if (code == 0) { /* errors were reset */
            CO_errorReset(co->em, FAULT_BIT, 0);
        } else {
            CO_errorReport(co->em, FAULT_BIT, code, 0);
        }
    }
}

/* -- what the application calls ---------------------------------------------------------------- */

uint16_t lax_glue_init(lax_glue_t *glue, CO_t *co, OD_t *od)
{
    unsigned i, j;
    lax_init(&glue->axis);
    glue->heard_host = glue->within_rpdo = false;
    glue->inputs = 0;
    glue->mode = 0;
    for (i = 0; i < LAX_GLUE_OBJECTS; i++) {
        OD_extension_t *extension = &glue->extensions[i];
        extension->object = glue;
        extension->read = read_axis;
        extension->write = write_axis;
        for (j = 0; j < OD_FLAGS_PDO_SIZE; j++) {
            extension->flagsPDO[j] = 0xFF; /* a bit that is 0 asks for its TPDO */
        }
        if (OD_extension_init(OD_find(od, indices[i]), extension) != ODR_OK) {
            return indices[i];
        }
    }
    if ((glue->heartbeat_consumer = OD_find(od, 0x1016)) == NULL) {
        return 0x1016;
    }
    if ((glue->rpdo1 = OD_find(od, 0x1400)) == NULL) {
        return 0x1400;
    }
    CO_HBconsumer_initCallbackPre(co->HBcons, glue, hear_host);
    return 0;
}

void lax_glue_process(lax_glue_t *glue, CO_t *co, uint32_t dt, int64_t encoder)
{
    bool_t sync;
    CO_LOCK_OD(co->CANmodule); /* SDO requests are answered in another task */
    follow_stack(glue, co);
    lax_tick(&glue->axis, (int64_t)dt, encoder); /* the time that has passed until now */
    sync = CO_process_SYNC(co, dt, NULL);
    if (sync) {
        lax_sync(&glue->axis);
    }
    CO_process_TPDO(co, sync, dt, NULL); /* first: feedback is sampled before the setpoint acts */
    take_setpoint(glue, co, sync, dt);
    tell_changes(glue);
    tell_emergencies(glue, co);
    CO_UNLOCK_OD(co->CANmodule);
}
