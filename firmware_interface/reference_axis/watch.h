/* What the axis watches: its host, and how far its carriage is from where it should be. */
#ifndef LAX_WATCH_H
#define LAX_WATCH_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Each watch is armed by the first frame it watches, and speaks once. Ages in microseconds. */
typedef struct {
    int64_t setpoint_age;
    int64_t sync_age;
    int64_t heartbeat_age;
    bool setpoint_armed;
    bool heartbeat_armed;
    int64_t beyond_window; /* for how long the following error has been outside */
} lax_watch_t;

void lax_watch_init(lax_watch_t *watch);
void lax_watch_advance(lax_watch_t *watch, int64_t dt);
bool lax_watch_lost_heartbeat(lax_watch_t *watch, uint32_t consumer);
uint16_t lax_watch_lost_setpoints(lax_watch_t *watch, uint16_t timer);
bool lax_watch_following(lax_watch_t *watch, int64_t dt, int64_t error, uint32_t window,
                         uint16_t timeout);

#ifdef __cplusplus
}
#endif

#endif
