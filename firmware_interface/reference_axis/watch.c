#include "watch.h"

#include "axis.h"

#define MILLISECOND INT64_C(1000)

void lax_watch_init(lax_watch_t *watch)
{
    watch->setpoint_age = 0;
    watch->sync_age = 0;
    watch->heartbeat_age = 0;
    watch->setpoint_armed = false;
    watch->heartbeat_armed = false;
    watch->beyond_window = 0;
}

void lax_watch_advance(lax_watch_t *watch, int64_t dt)
{
    watch->setpoint_age += dt;
    watch->sync_age += dt;
    watch->heartbeat_age += dt;
}

/* Whether the heartbeat has just been lost; consumer is 0x1016:1. */
bool lax_watch_lost_heartbeat(lax_watch_t *watch, uint32_t consumer)
{
    int64_t limit = (int64_t)(consumer & 0xFFFFu) * MILLISECOND;
    if (!watch->heartbeat_armed || limit == 0 || watch->heartbeat_age <= limit) {
        return false;
    }
    watch->heartbeat_armed = false;
    return true;
}

/* The emergency if setpoints have just been lost, or 0; timer is 0x1400:5. */
uint16_t lax_watch_lost_setpoints(lax_watch_t *watch, uint16_t timer)
{
    int64_t limit = (int64_t)timer * MILLISECOND;
    if (!watch->setpoint_armed || limit == 0 || watch->setpoint_age <= limit) {
        return 0;
    }
    watch->setpoint_armed = false;
    return watch->sync_age > limit ? LAX_ERROR_SYNC_LOST : LAX_ERROR_SETPOINT_LOST;
}

/* Let dt pass with this following error; whether it has been outside for too long. */
bool lax_watch_following(lax_watch_t *watch, int64_t dt, int64_t error, uint32_t window,
                         uint16_t timeout)
{
    int64_t size = error < 0 ? -error : error;
    if (window == UINT32_MAX || size <= (int64_t)window) {
        watch->beyond_window = 0;
        return false;
    }
    watch->beyond_window += dt;
    return watch->beyond_window > (int64_t)timeout * MILLISECOND;
}
