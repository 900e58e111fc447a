/* One takeoff of the simple vertical model under the vertical loop: the loop of app/core/plants/vertical.py, written
 * the way a C programmer would, as the yardstick for the compiled Python. Build with -O2 -fwrapv. */

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

enum { ZETA_OMEGA = 1519, OMEGA_2 = 389, SPEED_MAX = 393216, ACCELERATION_MIN = -5022, ACCELERATION_MAX = 2009,
       WEIGHT = 2571632, INVERSE_MASS = 408, R33 = 16384, R33_MIN = 8578 };

typedef struct {
    int64_t p;
    int32_t v, a, sum, z_ref, zd_ref, zdd_ref, ff_cmd, fb_cmd;
    int64_t largest_product;
    int32_t check_phase, checks_passed;
} Loop;

static int32_t limit(int32_t value, int32_t low, int32_t high) {
    return value < low ? low : value > high ? high : value;
}

static void remember(Loop *loop, int64_t product) {
    int64_t size = llabs(product);
    if (size > loop->largest_product)
        loop->largest_product = size;
}

static int detect_flight(Loop *loop, int32_t thrust) {
    if (loop->checks_passed < 20) {
        if (loop->check_phase >= 512) {
            loop->check_phase -= 512;
            loop->checks_passed = thrust > 500 ? loop->checks_passed + 1 : 0;
        }
        loop->check_phase += 20;
    }
    return loop->checks_passed >= 20;
}

static int32_t step(Loop *loop, int32_t target, int32_t kp, int32_t ki, int32_t kd, int32_t z, int32_t zd, int32_t r33,
                    int in_flight) {
    loop->p += loop->v;
    int32_t v = loop->v + loop->a;
    int32_t e = (int32_t)(-target - (loop->p >> 18));
    int32_t a = ((-2 * ZETA_OMEGA * (v >> 9)) >> 10) + ((OMEGA_2 * e) >> 7);
    a = limit(a, ACCELERATION_MIN, ACCELERATION_MAX);
    if (v <= -SPEED_MAX) {
        v = -SPEED_MAX;
        a = a > 0 ? a : 0;
    } else if (v >= SPEED_MAX) {
        v = SPEED_MAX;
        a = a < 0 ? a : 0;
    }
    loop->v = v;
    loop->a = a;
    loop->z_ref = (int32_t)(loop->p >> 18);
    loop->zd_ref = v << 2;
    loop->zdd_ref = a << 2;
    int32_t ez = limit(loop->z_ref - z, -2560, 2560);
    int32_t ev = limit(loop->zd_ref - zd, -5242880, 5242880);
    loop->sum = in_flight ? limit(loop->sum + ez, -2000000, 2000000) : 0;
    int32_t force = (WEIGHT - (loop->zdd_ref << 8)) / INVERSE_MASS;
    loop->ff_cmd = limit((force << 14) / (r33 > R33_MIN ? r33 : R33_MIN), 0, 8640);
    remember(loop, (int64_t)-kp * ez);
    remember(loop, (int64_t)-kd * ev);
    remember(loop, (int64_t)-ki * loop->sum);
    loop->fb_cmd = ((-kp * ez) >> 7) + ((-kd * ev) >> 16) + ((-ki * loop->sum) >> 16);
    return limit(loop->ff_cmd + loop->fb_cmd, 0, 9600);
}

int64_t rollout(int32_t kp, int32_t ki, int32_t kd, double hover, double lag, double drag, int32_t target, int64_t n,
                double *altitude) {
    Loop loop = {0};
    double height = 0.0, climb = 0.0, thrust = 0.0, response = lag > 1.0 / 512 ? 1.0 / 512 / lag : 1.0;
    int32_t command = 0;
    for (int64_t i = 0; i < n; i++) {
        int in_flight = detect_flight(&loop, command);
        int32_t z = (int32_t)floor(-height * 256 + 0.5), zd = (int32_t)floor(-climb * 524288 + 0.5);
        command = step(&loop, target, kp, ki, kd, z, zd, R33, in_flight);
        altitude[i] = height;
        thrust += response * (command / 9600.0 - thrust);
        double acceleration = 9.81 * (thrust / hover - 1.0) - drag * climb;
        height += climb * (1.0 / 512);
        climb += acceleration * (1.0 / 512);
        if (height <= 0.0) {
            height = 0.0;
            climb = climb > 0.0 ? climb : 0.0;
        }
    }
    return loop.largest_product;
}
