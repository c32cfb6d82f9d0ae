/* A linear-axis drive's application: CiA 402 states, setpoint latch, interpolation, watchdogs.
 *
 * C99, no heap, no operating system, no globals: everything is in the lax_axis_t of the caller,
 * and time comes in as microseconds. Behaviour in words and tables: ../README.md. The vectors of
 * ../conformance.json hold this code and the simulated Python drive to the same answers.
 *
 * In a drive: call lax_sync and then lax_setpoint (if one has come) at every SYNC, lax_heartbeat
 * at every heartbeat of the host, lax_tick from the control task, and hand lax_servo_demand to the
 * position loop. One task may be inside at a time: lock, or call everything from the control task.
 */
#ifndef LAX_AXIS_H
#define LAX_AXIS_H

#include <stdbool.h>
#include <stdint.h>

#include "demand.h"
#include "watch.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Emergency error codes, CiA 301 and CiA 402 */
#define LAX_ERROR_STO 0x5441u
#define LAX_ERROR_COMMUNICATION 0x8100u
#define LAX_ERROR_HEARTBEAT_LOST 0x8130u
#define LAX_ERROR_SETPOINT_LOST 0x8250u
#define LAX_ERROR_FOLLOWING 0x8611u
#define LAX_ERROR_HOMING 0x8613u
#define LAX_ERROR_SYNC_LOST 0x8700u

/* SDO abort codes, CiA 301; 0 is success */
#define LAX_NO_OBJECT 0x06020000u
#define LAX_OUT_OF_RANGE 0x06090030u
#define LAX_TOO_HIGH 0x06090031u
#define LAX_TOO_LOW 0x06090032u
#define LAX_WRONG_STATE 0x08000022u

#define LAX_INTERLOCK (1u << 3) /* of 0x60FD: safe torque off is active */
#define LAX_MOST_EMERGENCIES 8

typedef enum {
    LAX_NOT_READY_TO_SWITCH_ON,
    LAX_SWITCH_ON_DISABLED,
    LAX_READY_TO_SWITCH_ON,
    LAX_SWITCHED_ON,
    LAX_OPERATION_ENABLED,
    LAX_QUICK_STOP_ACTIVE,
    LAX_FAULT_REACTION_ACTIVE,
    LAX_FAULT,
    LAX_NO_STATE /* in after_stop: nothing follows */
} lax_state_t;

/* The objects that the host may write. */
typedef struct {
    uint32_t heartbeat_consumer; /* 0x1016:1 */
    uint16_t setpoint_timer;     /* 0x1400:5 [ms] */
    int16_t abort_option;        /* 0x6007 */
    uint16_t controlword;        /* 0x6040 */
    int16_t quick_stop_option;   /* 0x605A */
    int16_t shutdown_option;     /* 0x605B */
    int16_t disable_option;      /* 0x605C */
    int16_t halt_option;         /* 0x605D */
    int16_t fault_option;        /* 0x605E */
    int8_t mode;                 /* 0x6060 */
    uint32_t following_window;   /* 0x6065 [increments] */
    uint16_t following_timeout;  /* 0x6066 [ms] */
    int32_t target;              /* 0x607A [increments] */
    int32_t home_offset;         /* 0x607C [increments] */
    int32_t limit_low;           /* 0x607D:1 [increments] */
    int32_t limit_high;          /* 0x607D:2 [increments] */
    uint32_t greatest_velocity;  /* 0x607F [increments/s] */
    uint32_t quick_stop_ramp;    /* 0x6085 [increments/s^2] */
    int8_t homing_method;        /* 0x6098 */
    uint32_t homing_search;      /* 0x6099:1 [increments/s] */
    uint32_t homing_creep;       /* 0x6099:2 [increments/s] */
    uint32_t homing_ramp;        /* 0x609A [increments/s^2] */
    uint8_t period_value;        /* 0x60C2:1 */
    int8_t period_exponent;      /* 0x60C2:2 */
    uint32_t outputs;            /* 0x60FE:1 */
    uint32_t output_mask;        /* 0x60FE:2 */
} lax_objects_t;

typedef struct {
    lax_objects_t objects;
    lax_state_t state;
    lax_state_t after_stop; /* where to go once the carriage stands */
    lax_demand_t demand;
    lax_watch_t watch;
    int64_t actual;   /* 0x6064 [increments] */
    int64_t velocity; /* 0x606C [increments/s] */
    int64_t origin;   /* encoder reading at position 0 [increments] */
    uint32_t inputs;  /* 0x60FD without the interlock */
    uint16_t error_code;
    uint16_t emergencies[LAX_MOST_EMERGENCIES];
    uint8_t emergency_count;
    bool homed;
    bool sto;
    bool operational;
    bool halted;
    bool limited;
    bool following_error;
    bool homing_done;
    bool homing_error;
} lax_axis_t;

void lax_init(lax_axis_t *axis);

/* from the bus */
uint32_t lax_write(lax_axis_t *axis, uint16_t index, uint8_t sub, int64_t value);
uint32_t lax_read(const lax_axis_t *axis, uint16_t index, uint8_t sub, int64_t *value);
void lax_sync(lax_axis_t *axis);
void lax_setpoint(lax_axis_t *axis, uint16_t controlword, int32_t target);
void lax_heartbeat(lax_axis_t *axis);
void lax_communication(lax_axis_t *axis, bool operational);

/* from the hardware */
void lax_raise_fault(lax_axis_t *axis, uint16_t code);
void lax_set_sto(lax_axis_t *axis, bool active);
void lax_set_inputs(lax_axis_t *axis, uint32_t word);
void lax_tick(lax_axis_t *axis, int64_t dt, int64_t encoder);

/* to the hardware and the bus */
uint16_t lax_statusword(const lax_axis_t *axis);
uint8_t lax_error_register(const lax_axis_t *axis);
bool lax_powered(const lax_axis_t *axis);
bool lax_brake_released(const lax_axis_t *axis);
int64_t lax_servo_demand(const lax_axis_t *axis);   /* [1/256 increment], as the encoder counts */
int64_t lax_servo_velocity(const lax_axis_t *axis); /* [1/256 increment/s] */
int64_t lax_period(const lax_axis_t *axis);         /* [us] */
bool lax_take_emergency(lax_axis_t *axis, uint16_t *code);

#ifdef __cplusplus
}
#endif

#endif
