/* The objects of the application: reading, writing, limits. Defaults come from the EDS. */
#include "objects.h"

#include "linear_axis.h"

void lax_objects_init(lax_objects_t *o)
{
    o->heartbeat_consumer = LAX_CONSUMER_HEARTBEAT_TIME_HEARTBEAT_OF_THE_HOST_DEFAULT;
    o->setpoint_timer = LAX_RPDO1_COMMUNICATION_PARAMETER_EVENT_TIMER_DEFAULT;
    o->abort_option = LAX_ABORT_CONNECTION_OPTION_CODE_DEFAULT;
    o->controlword = LAX_CONTROLWORD_DEFAULT;
    o->quick_stop_option = LAX_QUICK_STOP_OPTION_CODE_DEFAULT;
    o->shutdown_option = LAX_SHUTDOWN_OPTION_CODE_DEFAULT;
    o->disable_option = LAX_DISABLE_OPERATION_OPTION_CODE_DEFAULT;
    o->halt_option = LAX_HALT_OPTION_CODE_DEFAULT;
    o->fault_option = LAX_FAULT_REACTION_OPTION_CODE_DEFAULT;
    o->mode = LAX_MODES_OF_OPERATION_DEFAULT;
    o->following_window = LAX_FOLLOWING_ERROR_WINDOW_DEFAULT;
    o->following_timeout = LAX_FOLLOWING_ERROR_TIME_OUT_DEFAULT;
    o->target = LAX_TARGET_POSITION_DEFAULT;
    o->home_offset = LAX_HOME_OFFSET_DEFAULT;
    o->limit_low = LAX_SOFTWARE_POSITION_LIMIT_MIN_POSITION_LIMIT_DEFAULT;
    o->limit_high = LAX_SOFTWARE_POSITION_LIMIT_MAX_POSITION_LIMIT_DEFAULT;
    o->greatest_velocity = LAX_MAX_PROFILE_VELOCITY_DEFAULT;
    o->quick_stop_ramp = LAX_QUICK_STOP_DECELERATION_DEFAULT;
    o->homing_method = LAX_HOMING_METHOD_DEFAULT;
    o->homing_search = LAX_HOMING_SPEEDS_SPEED_DURING_SEARCH_FOR_SWITCH_DEFAULT;
    o->homing_creep = LAX_HOMING_SPEEDS_SPEED_DURING_SEARCH_FOR_ZERO_DEFAULT;
    o->homing_ramp = LAX_HOMING_ACCELERATION_DEFAULT;
    o->period_value = LAX_INTERPOLATION_TIME_PERIOD_INTERPOLATION_TIME_PERIOD_VALUE_DEFAULT;
    o->period_exponent = LAX_INTERPOLATION_TIME_PERIOD_INTERPOLATION_TIME_INDEX_DEFAULT;
    o->outputs = LAX_DIGITAL_OUTPUTS_PHYSICAL_OUTPUTS_DEFAULT;
    o->output_mask = LAX_DIGITAL_OUTPUTS_BIT_MASK_DEFAULT;
}

/* X-macro: key, member, type, least, greatest. One line an object. */
#define OBJECTS(X)                                                                                \
    X(LAX_CONSUMER_HEARTBEAT_TIME_HEARTBEAT_OF_THE_HOST, heartbeat_consumer, uint32_t, 0,          \
      LAX_CONSUMER_HEARTBEAT_TIME_HEARTBEAT_OF_THE_HOST_MAX)                                       \
    X(LAX_RPDO1_COMMUNICATION_PARAMETER_EVENT_TIMER, setpoint_timer, uint16_t, 0, UINT16_MAX)      \
    X(LAX_ABORT_CONNECTION_OPTION_CODE, abort_option, int16_t, 0, 3)                               \
    X(LAX_CONTROLWORD, controlword, uint16_t, 0, UINT16_MAX)                                       \
    X(LAX_QUICK_STOP_OPTION_CODE, quick_stop_option, int16_t, INT16_MIN, INT16_MAX)                \
    X(LAX_SHUTDOWN_OPTION_CODE, shutdown_option, int16_t, 0, 1)                                    \
    X(LAX_DISABLE_OPERATION_OPTION_CODE, disable_option, int16_t, 0, 1)                            \
    X(LAX_HALT_OPTION_CODE, halt_option, int16_t, 1, 2)                                            \
    X(LAX_FAULT_REACTION_OPTION_CODE, fault_option, int16_t, INT16_MIN, INT16_MAX)                 \
    X(LAX_MODES_OF_OPERATION, mode, int8_t, INT8_MIN, INT8_MAX)                                    \
    X(LAX_FOLLOWING_ERROR_WINDOW, following_window, uint32_t, 0, UINT32_MAX)                       \
    X(LAX_FOLLOWING_ERROR_TIME_OUT, following_timeout, uint16_t, 0, UINT16_MAX)                    \
    X(LAX_TARGET_POSITION, target, int32_t, INT32_MIN, INT32_MAX)                                  \
    X(LAX_HOME_OFFSET, home_offset, int32_t, INT32_MIN, INT32_MAX)                                 \
    X(LAX_SOFTWARE_POSITION_LIMIT_MIN_POSITION_LIMIT, limit_low, int32_t, INT32_MIN, INT32_MAX)    \
    X(LAX_SOFTWARE_POSITION_LIMIT_MAX_POSITION_LIMIT, limit_high, int32_t, INT32_MIN, INT32_MAX)   \
    X(LAX_MAX_PROFILE_VELOCITY, greatest_velocity, uint32_t, LAX_MAX_PROFILE_VELOCITY_MIN,         \
      LAX_MAX_PROFILE_VELOCITY_MAX)                                                                \
    X(LAX_QUICK_STOP_DECELERATION, quick_stop_ramp, uint32_t, LAX_QUICK_STOP_DECELERATION_MIN,     \
      UINT32_MAX)                                                                                  \
    X(LAX_HOMING_METHOD, homing_method, int8_t, INT8_MIN, INT8_MAX)                                \
    X(LAX_HOMING_SPEEDS_SPEED_DURING_SEARCH_FOR_SWITCH, homing_search, uint32_t, 1, INT32_MAX)     \
    X(LAX_HOMING_SPEEDS_SPEED_DURING_SEARCH_FOR_ZERO, homing_creep, uint32_t, 1, INT32_MAX)        \
    X(LAX_HOMING_ACCELERATION, homing_ramp, uint32_t, 1, UINT32_MAX)                               \
    X(LAX_INTERPOLATION_TIME_PERIOD_INTERPOLATION_TIME_PERIOD_VALUE, period_value, uint8_t, 1,     \
      UINT8_MAX)                                                                                   \
    X(LAX_INTERPOLATION_TIME_PERIOD_INTERPOLATION_TIME_INDEX, period_exponent, int8_t,             \
      LAX_INTERPOLATION_TIME_PERIOD_INTERPOLATION_TIME_INDEX_MIN,                                  \
      LAX_INTERPOLATION_TIME_PERIOD_INTERPOLATION_TIME_INDEX_MAX)                                  \
    X(LAX_DIGITAL_OUTPUTS_PHYSICAL_OUTPUTS, outputs, uint32_t, 0, UINT32_MAX)                      \
    X(LAX_DIGITAL_OUTPUTS_BIT_MASK, output_mask, uint32_t, 0, UINT32_MAX)

static bool allowed(uint32_t key, int64_t value)
{
    switch (key) {
    case LAX_QUICK_STOP_OPTION_CODE:
        return value == 0 || value == 2 || value == 6;
    case LAX_FAULT_REACTION_OPTION_CODE:
        return value == 0 || value == 2;
    case LAX_MODES_OF_OPERATION:
        return value == 0 || value == LAX_MODE_HOMING || value == LAX_MODE_CSP;
    default:
        return true;
    }
}

#define WRITE(object, member, type, low, high)                                                    \
    case object:                                                                                   \
        if (value > (int64_t)(high)) {                                                             \
            return LAX_TOO_HIGH;                                                                   \
        }                                                                                          \
        if (value < (int64_t)(low)) {                                                              \
            return LAX_TOO_LOW;                                                                    \
        }                                                                                          \
        if (!allowed(object, value)) {                                                             \
            return LAX_OUT_OF_RANGE;                                                               \
        }                                                                                          \
        o->member = (type)value;                                                                   \
        return 0;

uint32_t lax_objects_write(lax_objects_t *o, uint32_t key, int64_t value)
{
    switch (key) {
        OBJECTS(WRITE)
    default:
        return LAX_NO_OBJECT;
    }
}

#define READ(object, member, type, low, high)                                                     \
    case object:                                                                                   \
        *value = (int64_t)o->member;                                                               \
        return 0;

uint32_t lax_objects_read(const lax_objects_t *o, uint32_t key, int64_t *value)
{
    switch (key) {
        OBJECTS(READ)
    default:
        return LAX_NO_OBJECT;
    }
}
