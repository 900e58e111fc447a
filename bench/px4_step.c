/* PX4's vertical loop, one step per row: the loop of app/autopilots/px4/replica/vertical.py, written the way a C programmer would, as
 * the yardstick for the compiled Python. Build with -O2. */

#include <math.h>
#include <stdint.h>

typedef struct {
    float position_p, velocity_p, velocity_i, velocity_d, climb, descent, thrust_min, thrust_max, hover, ramp_s, spool_s;
    float velocity_gain, derivative_gain, land_speed;
} Parameters;

typedef struct {
    float takeoff, velocity_target, acceleration_target, thrust, ramp_speed, derivative;
    float velocity, integral, hover_thrust, ramp, armed_s, set_z, set_velocity, set_acceleration;
} Loop;

typedef struct {
    float dt, z, vz, z_derivative, set_z, set_vz, set_az, set_new, hover_estimate;
    float armed, landed, ground_contact, want_takeoff, limit_up, limit_down;
} Inputs;

enum { DISARMED = 1, SPOOL_UP, READY, RAMP_UP, FLIGHT };

static const float GRAVITY = 9.80665f;

static float clip(float value, float low, float high) {
    return value < low ? low : value > high ? high : value;
}

static void advance_takeoff(Loop *s, const Parameters *p, float dt, int armed, int landed, int wanted) {
    int takeoff = (int)s->takeoff;
    s->armed_s = armed && takeoff != DISARMED ? s->armed_s + dt : 0.0f;
    if (takeoff == DISARMED && armed)
        takeoff = SPOOL_UP;
    if (takeoff == SPOOL_UP && s->armed_s >= p->spool_s - 1e-4f)
        takeoff = READY;
    if (takeoff == READY && wanted) {
        takeoff = RAMP_UP;
        s->ramp = 0.0f;
    }
    if (takeoff == RAMP_UP && s->ramp >= 1.0f)
        takeoff = FLIGHT;
    if (takeoff == FLIGHT && landed)
        takeoff = READY;
    if (!armed)
        takeoff = DISARMED;
    s->takeoff = (float)takeoff;
    float lowest = -GRAVITY / p->velocity_p;
    if (takeoff < RAMP_UP) {
        s->ramp_speed = lowest;
    } else if (takeoff == RAMP_UP) {
        s->ramp = p->ramp_s > 0.0f ? s->ramp + dt / p->ramp_s : 1.0f;
        s->ramp_speed = s->ramp < 1.0f ? lowest + s->ramp * (p->climb - lowest) : p->climb;
    } else {
        s->ramp_speed = p->climb;
    }
}

static void control(Loop *s, const Parameters *p, float dt, float z, float up, float down) {
    float target = p->position_p * (s->set_z - z);
    if (isnan(target))
        target = s->set_velocity;
    else if (!isnan(s->set_velocity))
        target += s->set_velocity;
    target = clip(target, -up, down);
    float integral = clip(s->integral, -GRAVITY, GRAVITY);
    float error = target - s->velocity;
    float a = p->velocity_p * error + integral - p->velocity_d * s->derivative;
    if (isnan(a))
        a = s->set_acceleration;
    else if (!isnan(s->set_acceleration))
        a += s->set_acceleration;
    float thrust = s->hover_thrust - a * s->hover_thrust / GRAVITY;
    float least = s->takeoff == FLIGHT ? p->thrust_min : 0.001f;
    if (thrust < least)
        thrust = least;
    int held = (thrust <= least && error >= 0.0f) || (thrust >= p->thrust_max && error <= 0.0f);
    if (!(held || isnan(error)))
        integral += p->velocity_i * error * dt;
    s->integral = integral;
    s->velocity_target = target;
    s->acceleration_target = a;
    s->thrust = thrust > p->thrust_max ? p->thrust_max : thrust;
}

static void step(Loop *s, const Parameters *p, const Inputs *in) {
    float dt = clip(in->dt, 0.002f, 0.04f), vz = in->vz;
    if (in->set_new > 0.0f) {
        s->set_z = in->set_z;
        s->set_velocity = in->set_vz;
        s->set_acceleration = in->set_az;
    }
    float speed = fabsf(s->set_velocity);
    if (isnan(s->set_z) && speed > 0.0f)
        vz += fminf(speed / p->land_speed, 1.0f) * (in->z_derivative - vz);
    float before = s->velocity;
    s->velocity += p->velocity_gain * (vz - before);
    s->derivative += p->derivative_gain * ((s->velocity - before) / dt - s->derivative);
    advance_takeoff(s, p, dt, in->armed > 0.0f, in->landed > 0.0f, in->want_takeoff > 0.0f);
    if (!isnan(in->hover_estimate)) {
        float estimate = clip(in->hover_estimate, 0.05f, 0.9f), a = s->acceleration_target;
        s->integral += (a - GRAVITY) * s->hover_thrust / estimate + GRAVITY - a;
        s->hover_thrust = estimate;
    }
    int flying = s->takeoff == FLIGHT;
    if (!flying)
        s->hover_thrust = p->hover;
    if (s->takeoff < RAMP_UP || (flying && in->ground_contact > 0.0f)) {
        s->integral = 0.0f;
        s->set_z = s->set_velocity = NAN;
        s->set_acceleration = 100.0f;
    } else if (!(flying || isnan(s->set_velocity))) {
        s->set_acceleration = NAN;
    }
    float up = flying ? fminf(in->limit_up, p->climb) : s->ramp_speed;
    control(s, p, dt, in->z, up, in->limit_down > 0.0f ? in->limit_down : 0.0f);
}

void rollout(Loop *s, const Parameters *p, const Inputs *inputs, int64_t n, float (*outputs)[6]) {
    for (int64_t i = 0; i < n; i++) {
        step(s, p, &inputs[i]);
        float *out = outputs[i];
        out[0] = s->takeoff;
        out[1] = s->velocity_target;
        out[2] = s->acceleration_target;
        out[3] = s->thrust;
        out[4] = s->ramp_speed;
        out[5] = s->derivative;
    }
}
