#include "demand.h"

#define LONGEST_STEP INT64_C(10000) /* [us] */

/* Divide and round down; b is above zero. */
int64_t lax_floor_div(int64_t a, int64_t b)
{
    int64_t quotient = a / b;
    return (a % b < 0) ? quotient - 1 : quotient;
}

static int64_t least(int64_t a, int64_t b) { return a < b ? a : b; }
static int64_t magnitude(int64_t a) { return a < 0 ? -a : a; }

void lax_demand_init(lax_demand_t *demand)
{
    lax_demand_place(demand, 0);
    demand->start = 0;
    demand->end = 0;
    demand->elapsed = 0;
    demand->period = 1;
}

/* Stand at a position. */
void lax_demand_place(lax_demand_t *demand, int64_t increments)
{
    demand->phase = LAX_HOLD;
    demand->position = increments * LAX_FRACTION;
    demand->velocity = 0;
}

/* Go to a setpoint, to be there after one period. */
void lax_demand_aim(lax_demand_t *demand, int64_t increments, int64_t period)
{
    demand->phase = LAX_FOLLOW;
    demand->start = demand->position;
    demand->end = increments * LAX_FRACTION;
    demand->elapsed = 0;
    demand->period = period;
    demand->velocity = lax_floor_div((demand->end - demand->start) * LAX_SECOND, period);
}

/* Slow down from here on. */
void lax_demand_brake(lax_demand_t *demand)
{
    if (demand->phase == LAX_FOLLOW) {
        demand->phase = LAX_BRAKE;
    }
}

static void slow_down(lax_demand_t *demand, int64_t dt, int64_t deceleration)
{
    int64_t before = demand->velocity;
    int64_t loss = deceleration * dt * LAX_FRACTION / LAX_SECOND;
    if (loss < 1) {
        loss = 1;
    }
    if (magnitude(before) <= loss) {
        int64_t rest = dt * magnitude(before) / loss; /* time until it stands */
        demand->position += lax_floor_div(before * rest, 2 * LAX_SECOND);
        demand->velocity = 0;
        demand->phase = LAX_HOLD;
        return;
    }
    demand->velocity = before > 0 ? before - loss : before + loss;
    demand->position += lax_floor_div((before + demand->velocity) * dt, 2 * LAX_SECOND);
}

/* Let time pass. deceleration: of the braking ramp [increments/s^2]. */
void lax_demand_advance(lax_demand_t *demand, int64_t dt, int64_t deceleration)
{
    if (demand->phase == LAX_FOLLOW) {
        int64_t late, within;
        demand->elapsed += dt;
        late = demand->elapsed - 2 * demand->period;
        within = late > 0 ? 2 * demand->period : demand->elapsed;
        demand->position =
            demand->start + lax_floor_div((demand->end - demand->start) * within, demand->period);
        if (late <= 0) {
            return;
        }
        demand->phase = LAX_BRAKE;
        dt = late;
    }
    while (demand->phase == LAX_BRAKE && dt > 0) {
        int64_t step = least(dt, LONGEST_STEP);
        slow_down(demand, step, deceleration);
        dt -= step;
    }
}
