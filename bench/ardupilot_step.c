/* ArduCopter's vertical loop in flight, one step per row: the loop of app/autopilots/ardupilot/replica/vertical.py, written the way a C
 * programmer would, as the yardstick for the compiled Python. Build with -O2. */

#include <math.h>
#include <stdint.h>

typedef struct {
    double position_p;
    double velocity_p, velocity_i, velocity_d, velocity_ff, velocity_imax, velocity_error_gain, velocity_derivative_gain;
    double acceleration_p, acceleration_i, acceleration_d, acceleration_ff, acceleration_d_ff, acceleration_imax;
    double target_gain, acceleration_error_gain, acceleration_derivative_gain;
    double jerk, climb, descent, acceleration, hover, ramp_step, ramp_end;
    double dt, throttle_gain, relaxation_gain;
} Parameters;

typedef struct {
    double z_d, v_d, a_d, v_t, a_t, acceleration_sum, throttle, throttle_filtered;
    double position_error, position_error_min, position_error_max;
    double velocity_error, velocity_derivative, velocity_sum;
    double filtered_target, acceleration_error, acceleration_derivative;
    double saturated, reset, phase, spool_left, unfiltered;
} Loop;

static double clip(double value, double low, double high) {
    return value < low ? low : value > high ? high : value;
}

static double square_root(double error, double p, double limit, double dt) {
    double rate;
    if (limit <= 0.0) {
        rate = p * error;
    } else if (p == 0.0) {
        rate = copysign(sqrt(2.0 * limit * fabs(error)), error);
    } else {
        double linear = limit / (p * p);
        rate = fabs(error) <= linear ? p * error : copysign(sqrt(2.0 * limit * (fabs(error) - 0.5 * linear)), error);
    }
    if (dt > 0.0) {
        double largest = fabs(error) / dt;
        rate = clip(rate, -largest, largest);
    }
    return rate;
}

static void shape(Loop *s, const Parameters *p, double target) {
    double acceleration = p->acceleration, jerk = p->jerk, dt = p->dt;
    if (s->v_d > p->climb || s->v_d < -p->descent) {
        double factor = 2.0 * s->v_d / (s->v_d > 0.0 ? p->climb : -p->descent);
        acceleration *= factor;
        jerk *= factor;
    }
    double change = s->v_d * dt + 0.5 * s->a_d * dt * dt;
    if (!(change * s->saturated > 0.0 && s->position_error * s->saturated > 0.0))
        s->z_d += change;
    change = s->a_d * dt;
    if (change * s->saturated > 0.0 && s->velocity_error * s->saturated > 0.0)
        change = s->v_d * s->saturated < 0.0 ? clip(change, -fabs(s->v_d), fabs(s->v_d)) : 0.0;
    s->v_d += change;
    double downward = clip(acceleration, 0.0, 7.5);
    double error = target - s->z_d;
    double braking = error > 0.0 ? downward : acceleration;
    double rate = clip(square_root(error, 0.5 * jerk / braking, 0.5 * braking, dt), -p->descent, p->climb);
    error = rate - s->v_d;
    double wanted = square_root(error, jerk / (error > 0.0 ? acceleration : downward), jerk, dt);
    wanted = clip(wanted, -downward, acceleration);
    s->a_d += clip(wanted - s->a_d, -jerk * dt, jerk * dt);
}

static void control_position(Loop *s, const Parameters *p, double z) {
    double error = s->z_d - z;
    s->position_error = clip(error, s->position_error_min, s->position_error_max);
    if (s->position_error != error)
        s->z_d = z + s->position_error;
    s->v_t = square_root(s->position_error, p->position_p, p->acceleration, 0.0) + s->v_d;
}

static void control_velocity(Loop *s, const Parameters *p, double v, int lower, int upper) {
    double difference = 100.0 * (s->v_t - v), before = s->velocity_error;
    if (s->reset > 0.0) {
        s->velocity_error = difference;
        s->velocity_derivative = 0.0;
    } else {
        s->velocity_error += p->velocity_error_gain * (difference - before);
        s->velocity_derivative +=
            p->velocity_derivative_gain * ((s->velocity_error - before) / p->dt - s->velocity_derivative);
    }
    if (p->velocity_i == 0.0)
        s->velocity_sum = 0.0;
    else if (!((lower && s->velocity_error < 0.0) || (upper && s->velocity_error > 0.0)))
        s->velocity_sum =
            clip(s->velocity_sum + p->velocity_i * s->velocity_error * p->dt, -p->velocity_imax, p->velocity_imax);
    double feedback = p->velocity_p * s->velocity_error + s->velocity_sum + p->velocity_d * s->velocity_derivative;
    s->a_t = (feedback + p->velocity_ff * 100.0 * s->v_t) / 100.0 + s->a_d;
}

static void control_acceleration(Loop *s, const Parameters *p, double a, int lower, int upper) {
    double target_rate = 0.0;
    if (s->reset > 0.0) {
        s->filtered_target = 100.0 * s->a_t;
        s->acceleration_error = s->filtered_target - 100.0 * a;
        s->acceleration_derivative = 0.0;
    } else {
        double change = p->target_gain * (100.0 * s->a_t - s->filtered_target);
        s->filtered_target += change;
        target_rate = change / p->dt;
        change = p->acceleration_error_gain * (s->filtered_target - 100.0 * a - s->acceleration_error);
        s->acceleration_error += change;
        s->acceleration_derivative += p->acceleration_derivative_gain * (change / p->dt - s->acceleration_derivative);
    }
    s->reset = 0.0;
    if (p->acceleration_i == 0.0)
        s->acceleration_sum = 0.0;
    else if (!(lower || upper) || s->acceleration_sum * s->acceleration_error < 0.0)
        s->acceleration_sum = clip(s->acceleration_sum + p->acceleration_i * s->acceleration_error * p->dt,
                                   -p->acceleration_imax, p->acceleration_imax);
    double feedback = p->acceleration_p * s->acceleration_error + p->acceleration_d * s->acceleration_derivative +
                      s->acceleration_sum;
    double feed_forward = p->acceleration_ff * s->filtered_target + p->acceleration_d_ff * target_rate;
    s->throttle = p->hover + (feedback + feed_forward) / 1000.0;
    s->saturated = upper ? 1.0 : lower ? -1.0 : 0.0;
}

static void step(Loop *s, const Parameters *p, double target, double z, double v, double a, int lower, int upper) {
    double gain = s->unfiltered > 0.0 ? 1.0 : p->throttle_gain;
    s->throttle_filtered = clip(s->throttle_filtered + gain * (s->throttle - s->throttle_filtered), 0.0, 1.0);
    s->unfiltered = 0.0;
    shape(s, p, target);
    control_position(s, p, z);
    control_velocity(s, p, v, lower, upper);
    control_acceleration(s, p, a, lower, upper);
}

void rollout(Loop *s, const Parameters *p, const double (*inputs)[6], int64_t n, double (*outputs)[8]) {
    for (int64_t i = 0; i < n; i++) {
        const double *row = inputs[i];
        step(s, p, row[0], row[1], row[2], row[3], row[4] > 0.0, row[5] > 0.0);
        double *out = outputs[i];
        out[0] = s->z_d;
        out[1] = s->v_d;
        out[2] = s->a_d;
        out[3] = s->v_t;
        out[4] = s->a_t;
        out[5] = s->acceleration_sum;
        out[6] = s->throttle;
        out[7] = s->throttle_filtered;
    }
}
