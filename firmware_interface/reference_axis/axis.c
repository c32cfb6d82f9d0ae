#include "axis.h"

#include "linear_axis.h"
#include "objects.h"

/* statusword bits beside the state's own */
#define VOLTAGE_ENABLED (1u << 4)
#define REMOTE (1u << 9)
#define TARGET_REACHED (1u << 10)
#define INTERNAL_LIMIT (1u << 11)
#define BIT_12 (1u << 12) /* CSP: follows; homing: attained */
#define BIT_13 (1u << 13) /* CSP: following error; homing: error */

/* controlword bits */
#define HOMING_START (1u << 4)
#define FAULT_RESET (1u << 7)
#define HALT (1u << 8)

typedef enum { DISABLE_VOLTAGE, QUICK_STOP, SHUTDOWN, SWITCH_ON, ENABLE } command_t;

/* of the statusword, in the order of lax_state_t */
static const uint16_t patterns[] = {
    0x0000, /* not ready to switch on */
    0x0040, /* switch on disabled */
    0x0021, /* ready to switch on */
    0x0023, /* switched on */
    0x0027, /* operation enabled */
    0x0007, /* quick stop active */
    0x000F, /* fault reaction active */
    0x0008, /* fault */
};

static int64_t clip(int64_t value, int64_t low, int64_t high)
{
    return value < low ? low : value > high ? high : value;
}

/* -- what the axis says ------------------------------------------------------------------------ */

bool lax_powered(const lax_axis_t *axis)
{
    return axis->state == LAX_OPERATION_ENABLED || axis->state == LAX_QUICK_STOP_ACTIVE ||
           axis->state == LAX_FAULT_REACTION_ACTIVE;
}

bool lax_brake_released(const lax_axis_t *axis)
{
    return lax_powered(axis) && !(axis->objects.outputs & axis->objects.output_mask & 1u);
}

int64_t lax_servo_demand(const lax_axis_t *axis)
{
    return axis->demand.position + axis->origin * LAX_FRACTION;
}

int64_t lax_servo_velocity(const lax_axis_t *axis) { return axis->demand.velocity; }

int64_t lax_period(const lax_axis_t *axis)
{
    int64_t unit = LAX_SECOND;
    int exponent;
    for (exponent = axis->objects.period_exponent; exponent < 0; exponent++) {
        unit /= 10;
    }
    return axis->objects.period_value * unit;
}

/* Whether setpoints act now. */
static bool follows(const lax_axis_t *axis)
{
    return axis->state == LAX_OPERATION_ENABLED && axis->after_stop == LAX_NO_STATE &&
           !axis->halted && axis->objects.mode == LAX_MODE_CSP;
}

uint16_t lax_statusword(const lax_axis_t *axis)
{
    uint32_t word = patterns[axis->state] | REMOTE;
    bool twelve = follows(axis), thirteen = axis->following_error;
    if (!axis->sto) {
        word |= VOLTAGE_ENABLED;
    }
    if (axis->limited) {
        word |= INTERNAL_LIMIT;
    }
    if (axis->objects.mode == LAX_MODE_HOMING) {
        word |= axis->demand.phase == LAX_HOLD ? TARGET_REACHED : 0u;
        twelve = axis->homing_done;
        thirteen = axis->homing_error;
    }
    word |= twelve ? BIT_12 : 0u;
    word |= thirteen ? BIT_13 : 0u;
    return (uint16_t)word;
}

uint8_t lax_error_register(const lax_axis_t *axis)
{
    uint8_t bits = axis->error_code ? 1u : 0u;
    switch (axis->error_code >> 12) {
    case 2: bits |= 0x02u; break;
    case 3: bits |= 0x04u; break;
    case 4: bits |= 0x08u; break;
    default: break;
    }
    switch (axis->error_code >> 8) {
    case 0x81: case 0x82: case 0x87: bits |= 0x10u; break;
    case 0x86: bits |= 0x20u; break;
    default: break;
    }
    return bits;
}

bool lax_take_emergency(lax_axis_t *axis, uint16_t *code)
{
    uint8_t i;
    if (axis->emergency_count == 0) {
        return false;
    }
    *code = axis->emergencies[0];
    axis->emergency_count--;
    for (i = 0; i < axis->emergency_count; i++) {
        axis->emergencies[i] = axis->emergencies[i + 1];
    }
    return true;
}

uint32_t lax_read(const lax_axis_t *axis, uint16_t index, uint8_t sub, int64_t *value)
{
    int64_t error = lax_floor_div(axis->demand.position, LAX_FRACTION) - axis->actual;
    switch (LAX_KEY(index, sub)) {
    case LAX_POSITION_REFERENCE_KNOWN: *value = axis->homed; return 0;
    case LAX_ERROR_CODE: *value = axis->error_code; return 0;
    case LAX_STATUSWORD: *value = lax_statusword(axis); return 0;
    case LAX_MODES_OF_OPERATION_DISPLAY: *value = axis->objects.mode; return 0;
    case LAX_POSITION_ACTUAL_VALUE: *value = clip(axis->actual, INT32_MIN, INT32_MAX); return 0;
    case LAX_VELOCITY_ACTUAL_VALUE: *value = clip(axis->velocity, INT32_MIN, INT32_MAX); return 0;
    case LAX_FOLLOWING_ERROR_ACTUAL_VALUE:
        *value = lax_powered(axis) ? clip(error, INT32_MIN, INT32_MAX) : 0;
        return 0;
    case LAX_DIGITAL_INPUTS: *value = axis->inputs | (axis->sto ? LAX_INTERLOCK : 0u); return 0;
    default: return lax_objects_read(&axis->objects, LAX_KEY(index, sub), value);
    }
}

/* -- motion ------------------------------------------------------------------------------------ */

/* Make a position demand and target both. */
static void stand(lax_axis_t *axis, int64_t position)
{
    lax_demand_place(&axis->demand, position);
    axis->objects.target = (int32_t)clip(position, INT32_MIN, INT32_MAX);
}

/* Follow a setpoint within the software limits and the greatest speed. */
static void aim(lax_axis_t *axis, int32_t target)
{
    const lax_objects_t *o = &axis->objects;
    int64_t period = lax_period(axis);
    int64_t here = lax_floor_div(axis->demand.position, LAX_FRACTION);
    int64_t reach = (int64_t)o->greatest_velocity * period / LAX_SECOND;
    int64_t goal = target;
    if (reach < 1) {
        reach = 1;
    }
    if (axis->homed && o->limit_low < o->limit_high) {
        goal = clip(goal, o->limit_low, o->limit_high);
    }
    goal = clip(goal, here - reach, here + reach);
    axis->limited = goal != target;
    lax_demand_aim(&axis->demand, goal, period);
}

/* Brake; once it stands, go to a state. */
static void stop(lax_axis_t *axis, lax_state_t goal)
{
    lax_demand_brake(&axis->demand);
    axis->after_stop = lax_powered(axis) ? goal : LAX_NO_STATE;
}

/* -- states ------------------------------------------------------------------------------------ */

static void raise_emergency(lax_axis_t *axis, uint16_t code)
{
    axis->error_code = code;
    if (axis->emergency_count < LAX_MOST_EMERGENCIES) {
        axis->emergencies[axis->emergency_count++] = code;
    }
}

static void switch_off(lax_axis_t *axis)
{
    axis->state = LAX_SWITCH_ON_DISABLED;
    axis->after_stop = LAX_NO_STATE;
}

static void quick_stop(lax_axis_t *axis)
{
    if (axis->objects.quick_stop_option == 0) {
        switch_off(axis);
        return;
    }
    axis->state = LAX_QUICK_STOP_ACTIVE;
    stop(axis, axis->objects.quick_stop_option == 2 ? LAX_SWITCH_ON_DISABLED : LAX_NO_STATE);
}

/* Begin to hold the carriage where it is; then the target acts, whatever it is. */
static void enable(lax_axis_t *axis)
{
    lax_demand_place(&axis->demand, axis->actual);
    axis->halted = axis->limited = false;
    axis->watch.beyond_window = 0;
    axis->after_stop = LAX_NO_STATE;
    axis->state = LAX_OPERATION_ENABLED;
    if (axis->objects.mode == LAX_MODE_CSP) {
        aim(axis, axis->objects.target);
    }
}

/* Homing method 37: here is the position 0x607C. */
static void home(lax_axis_t *axis)
{
    if (axis->objects.homing_method != 37) {
        axis->homing_error = true;
        axis->homing_done = false;
        raise_emergency(axis, LAX_ERROR_HOMING);
        return;
    }
    axis->origin += axis->actual - axis->objects.home_offset;
    axis->actual = axis->objects.home_offset;
    stand(axis, axis->actual);
    axis->homed = axis->homing_done = true;
    axis->homing_error = false;
}

void lax_raise_fault(lax_axis_t *axis, uint16_t code)
{
    bool ramp;
    if (axis->state == LAX_FAULT || axis->state == LAX_FAULT_REACTION_ACTIVE) {
        return;
    }
    raise_emergency(axis, code);
    ramp = lax_powered(axis) && axis->objects.fault_option == 2 && !axis->sto;
    axis->state = ramp ? LAX_FAULT_REACTION_ACTIVE : LAX_FAULT;
    stop(axis, LAX_FAULT);
}

/* Do what 0x6007 says: nothing, fault, power off, or quick stop. */
static void lose_communication(lax_axis_t *axis, uint16_t code)
{
    int16_t option = axis->objects.abort_option;
    if (axis->state == LAX_OPERATION_ENABLED && option == 1) {
        lax_raise_fault(axis, code);
        return;
    }
    raise_emergency(axis, code);
    if (axis->state != LAX_OPERATION_ENABLED || option == 0) {
        return;
    }
    if (option == 2) {
        switch_off(axis);
    } else {
        quick_stop(axis);
    }
}

static command_t command_of(uint16_t word)
{
    if (!(word & 0x02u)) {
        return DISABLE_VOLTAGE;
    }
    if (!(word & 0x04u)) {
        return QUICK_STOP;
    }
    if (!(word & 0x01u)) {
        return SHUTDOWN;
    }
    return (word & 0x08u) ? ENABLE : SWITCH_ON;
}

static void command_enabled(lax_axis_t *axis, uint16_t word, uint16_t rising)
{
    switch (command_of(word)) {
    case DISABLE_VOLTAGE: switch_off(axis); break;
    case QUICK_STOP: quick_stop(axis); break;
    case SHUTDOWN:
        if (axis->objects.shutdown_option == 1) {
            stop(axis, LAX_READY_TO_SWITCH_ON);
        } else {
            axis->state = LAX_READY_TO_SWITCH_ON;
        }
        break;
    case SWITCH_ON:
        if (axis->objects.disable_option == 1) {
            stop(axis, LAX_SWITCHED_ON);
        } else {
            axis->state = LAX_SWITCHED_ON;
        }
        break;
    case ENABLE:
        axis->halted = (word & HALT) != 0;
        if (axis->halted) {
            lax_demand_brake(&axis->demand);
        }
        if (axis->objects.mode == LAX_MODE_HOMING && (rising & HOMING_START)) {
            home(axis);
        }
        break;
    }
}

/* Transitions without power (CiA 402-2): 2, 3, 4, 6, 7, 9, 10, 12. */
static void command_idle(lax_axis_t *axis, command_t command)
{
    bool ready = axis->state == LAX_READY_TO_SWITCH_ON, on = axis->state == LAX_SWITCHED_ON;
    if ((ready || on) && (command == DISABLE_VOLTAGE || command == QUICK_STOP)) {
        axis->state = LAX_SWITCH_ON_DISABLED;
    } else if ((on || axis->state == LAX_SWITCH_ON_DISABLED) && command == SHUTDOWN) {
        axis->state = LAX_READY_TO_SWITCH_ON;
    } else if (ready && command == SWITCH_ON) {
        axis->state = LAX_SWITCHED_ON;
    } else if ((ready || on) && command == ENABLE) {
        enable(axis);
    }
}

static void act_on_controlword(lax_axis_t *axis, uint16_t before, uint16_t word)
{
    uint16_t rising = (uint16_t)(word & ~before);
    command_t command = command_of(word);
    if ((rising & FAULT_RESET) && axis->state == LAX_FAULT && !axis->sto) {
        axis->state = LAX_SWITCH_ON_DISABLED;
        axis->following_error = false;
        raise_emergency(axis, 0);
        return;
    }
    if (axis->after_stop != LAX_NO_STATE && command != DISABLE_VOLTAGE && command != QUICK_STOP) {
        return;
    }
    if (axis->state == LAX_OPERATION_ENABLED) {
        command_enabled(axis, word, rising);
    } else if (axis->state == LAX_QUICK_STOP_ACTIVE) {
        if (command == DISABLE_VOLTAGE) { /* no way back up: a host that has not noticed */
            switch_off(axis);             /* would still be commanding 0xF */
        }
    } else if (!axis->sto) {
        command_idle(axis, command);
    }
}

/* -- from the bus ------------------------------------------------------------------------------ */

void lax_init(lax_axis_t *axis)
{
    lax_objects_init(&axis->objects);
    axis->state = LAX_NOT_READY_TO_SWITCH_ON;
    axis->after_stop = LAX_NO_STATE;
    lax_demand_init(&axis->demand);
    lax_watch_init(&axis->watch);
    axis->actual = axis->velocity = axis->origin = 0;
    axis->inputs = 0;
    axis->error_code = 0;
    axis->emergency_count = 0;
    axis->homed = axis->sto = axis->operational = axis->halted = false;
    axis->limited = axis->following_error = false;
    axis->homing_done = axis->homing_error = false;
}

static uint32_t change_mode(lax_axis_t *axis, int64_t mode)
{
    int8_t before = axis->objects.mode;
    uint32_t refusal = lax_objects_write(&axis->objects, LAX_MODES_OF_OPERATION, mode);
    if (refusal) {
        return refusal;
    }
    if (lax_powered(axis) && axis->demand.velocity != 0) {
        axis->objects.mode = before;
        return LAX_WRONG_STATE;
    }
    if (mode != before && lax_powered(axis)) {
        stand(axis, lax_floor_div(axis->demand.position, LAX_FRACTION));
    }
    axis->homing_done = axis->homing_error = false;
    return 0;
}

uint32_t lax_write(lax_axis_t *axis, uint16_t index, uint8_t sub, int64_t value)
{
    uint32_t key = LAX_KEY(index, sub), refusal;
    uint16_t before = axis->objects.controlword;
    if (key == LAX_MODES_OF_OPERATION) {
        return change_mode(axis, value);
    }
    refusal = lax_objects_write(&axis->objects, key, value);
    if (refusal) {
        return refusal;
    }
    if (key == LAX_CONTROLWORD) {
        act_on_controlword(axis, before, axis->objects.controlword);
    } else if (key == LAX_TARGET_POSITION && follows(axis)) {
        aim(axis, axis->objects.target);
    } else if (key == LAX_CONSUMER_HEARTBEAT_TIME_HEARTBEAT_OF_THE_HOST) {
        axis->watch.heartbeat_armed = false;
    }
    return 0;
}

void lax_sync(lax_axis_t *axis) { axis->watch.sync_age = 0; }

void lax_setpoint(lax_axis_t *axis, uint16_t controlword, int32_t target)
{
    uint16_t before = axis->objects.controlword;
    axis->objects.controlword = controlword;
    axis->objects.target = target;
    axis->watch.setpoint_age = 0;
    axis->watch.setpoint_armed = axis->operational;
    act_on_controlword(axis, before, controlword);
    if (follows(axis)) {
        aim(axis, target);
    }
}

void lax_heartbeat(lax_axis_t *axis)
{
    axis->watch.heartbeat_age = 0;
    axis->watch.heartbeat_armed = true;
}

void lax_communication(lax_axis_t *axis, bool operational)
{
    bool left = axis->operational && !operational;
    axis->operational = operational;
    if (left) {
        axis->watch.setpoint_armed = false;
        if (axis->state == LAX_OPERATION_ENABLED) {
            lose_communication(axis, LAX_ERROR_COMMUNICATION);
        }
    }
}

/* -- from the hardware ------------------------------------------------------------------------- */

void lax_set_sto(lax_axis_t *axis, bool active)
{
    axis->sto = active;
    if (!active) {
        return;
    }
    if (lax_powered(axis)) {
        lax_raise_fault(axis, LAX_ERROR_STO);
    } else if (axis->state != LAX_FAULT) {
        axis->state = LAX_SWITCH_ON_DISABLED;
    }
}

void lax_set_inputs(lax_axis_t *axis, uint32_t word) { axis->inputs = word & ~LAX_INTERLOCK; }

static void watch_host(lax_axis_t *axis, int64_t dt)
{
    lax_watch_advance(&axis->watch, dt);
    if (lax_watch_lost_heartbeat(&axis->watch, axis->objects.heartbeat_consumer)) {
        lose_communication(axis, LAX_ERROR_HEARTBEAT_LOST);
    }
    if (axis->state == LAX_OPERATION_ENABLED && axis->objects.mode == LAX_MODE_CSP) {
        uint16_t code = lax_watch_lost_setpoints(&axis->watch, axis->objects.setpoint_timer);
        if (code) {
            lose_communication(axis, code);
        }
    }
}

/* Let dt microseconds pass, at whose end the encoder reads this many increments. */
void lax_tick(lax_axis_t *axis, int64_t dt, int64_t encoder)
{
    int64_t position = encoder - axis->origin, error;
    axis->velocity = dt > 0 ? lax_floor_div((position - axis->actual) * LAX_SECOND, dt) : 0;
    axis->actual = position;
    if (axis->state == LAX_NOT_READY_TO_SWITCH_ON) {
        axis->state = LAX_SWITCH_ON_DISABLED;
    }
    watch_host(axis, dt);
    if (!lax_powered(axis)) {
        lax_demand_place(&axis->demand, position);
        axis->limited = false;
        return;
    }
    lax_demand_advance(&axis->demand, dt, axis->objects.quick_stop_ramp);
    error = lax_floor_div(axis->demand.position, LAX_FRACTION) - position;
    if (lax_watch_following(&axis->watch, dt, error, axis->objects.following_window,
                            axis->objects.following_timeout)) {
        axis->following_error = true;
        lax_raise_fault(axis, LAX_ERROR_FOLLOWING);
    }
    if (axis->after_stop != LAX_NO_STATE && axis->demand.phase == LAX_HOLD) {
        axis->state = axis->after_stop;
        axis->after_stop = LAX_NO_STATE;
    }
}
