// A step of environments written by hand for one scene and one method: a pendulum without losses, rk4, energies.
//
// It takes the same operations in the same order as the package's program, on the same arrays, so that the bits are
// equal; but in one pass, with all numbers of a step in registers, and two vectors of 8 numbers at a time.
// Environments come in whole vectors, here a multiple of 16.

#include <string.h>

enum { WIDTH = 8, PAIR = 2, TOGETHER = WIDTH * PAIR };

typedef double Numbers __attribute__((vector_size(8 * WIDTH)));
typedef long long Truths __attribute__((vector_size(8 * WIDTH)));
typedef float Floats __attribute__((vector_size(4 * WIDTH)));
typedef signed char Bytes __attribute__((vector_size(WIDTH)));

#define INLINE static inline __attribute__((always_inline))
#define EACH for (int k = 0; k < PAIR; k++)

struct V { Numbers part[PAIR]; };
struct M { Truths part[PAIR]; };

#define ARITHMETIC(op) \
    INLINE V operator op(V a, V b) { V r; EACH r.part[k] = a.part[k] op b.part[k]; return r; } \
    INLINE V operator op(double a, V b) { V r; EACH r.part[k] = a op b.part[k]; return r; } \
    INLINE V operator op(V a, double b) { V r; EACH r.part[k] = a.part[k] op b; return r; }
#define COMPARISON(op) \
    INLINE M operator op(V a, V b) { M r; EACH r.part[k] = a.part[k] op b.part[k]; return r; } \
    INLINE M operator op(V a, double b) { M r; EACH r.part[k] = a.part[k] op b; return r; }
ARITHMETIC(+) ARITHMETIC(-) ARITHMETIC(*) ARITHMETIC(/)
COMPARISON(<) COMPARISON(<=) COMPARISON(>) COMPARISON(==) COMPARISON(!=)

INLINE V operator-(V a) { V r; EACH r.part[k] = -a.part[k]; return r; }
INLINE M operator&(M a, M b) { M r; EACH r.part[k] = a.part[k] & b.part[k]; return r; }
INLINE V size(V a) { V r; EACH r.part[k] = (Numbers)((Truths)a.part[k] & 0x7fffffffffffffffLL); return r; }
INLINE V all(double a) { V r; EACH r.part[k] = a - (Numbers){0}; return r; }
INLINE V choose(M m, V a, V b) { V r; EACH r.part[k] = m.part[k] ? a.part[k] : b.part[k]; return r; }
INLINE V load(const double *from) { V r; EACH memcpy(&r.part[k], from + WIDTH * k, sizeof(Numbers)); return r; }
INLINE void store(double *to, V a) { EACH memcpy(to + WIDTH * k, &a.part[k], sizeof(Numbers)); }

INLINE V actions(const float *from) {
    V r;
    EACH {
        Floats found;
        memcpy(&found, from + WIDTH * k, sizeof found);
        r.part[k] = __builtin_convertvector(found, Numbers);
    }
    return choose(r < -1.0, all(-1.0), choose(r < 1.0, r, all(1.0)));
}

INLINE Truths store(unsigned char *to, M a) {
    Truths any = a.part[0];
    EACH {
        Bytes found = __builtin_convertvector(a.part[k], Bytes) & 1;
        memcpy(to + WIDTH * k, &found, sizeof found);
        any |= a.part[k];
    }
    return any;
}

INLINE void store_rows(float *to, V x, V y, V z) {
    EACH {
        Floats a = __builtin_convertvector(x.part[k], Floats), b = __builtin_convertvector(y.part[k], Floats);
        Floats c = __builtin_convertvector(z.part[k], Floats);
        auto ab = __builtin_shufflevector(a, b, 0, 8, 1, 9, 2, 10, 3, 11, 4, 12, 5, 13, 6, 14, 7, 15);
        auto c2 = __builtin_shufflevector(c, c, 0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7);
        auto low = __builtin_shufflevector(ab, c2, 0, 1, 16, 2, 3, 17, 4, 5, 18, 6, 7, 19, 8, 9, 20, 10);
        auto high = __builtin_shufflevector(ab, c2, 11, 21, 12, 13, 22, 14, 15, 23);
        memcpy(to + 3 * WIDTH * k, &low, sizeof low);
        memcpy(to + 3 * WIDTH * k + 16, &high, sizeof high);
    }
}

const double ROUND = 6755399441055744.0;

INLINE V sine_near_zero(V y, V low, V z) {
    V r = 2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10);
    r = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * r);
    return y - (low * (1.0 - 0.5 * z) - z * y * (-1.66666666666666324348e-01 + z * r));
}

INLINE V cosine_near_zero(V y, V low, V z) {
    V r = -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11);
    r = -1.38888888888741095749e-03 + z * (2.48015872894767294178e-05 + z * r);
    V h = 0.5 * z, c = 1.0 - h;
    return c + (((1.0 - c) - h) + (z * z * (4.16666666666666019037e-02 + z * r) + y * low));
}

INLINE V sine(V x) {
    V k = (x * 0.6366197723675814 + ROUND) - ROUND;
    V m = k - ((k + 4 * ROUND) - 4 * ROUND);
    V a = (x - k * 1.570796251296997) - k * 7.549789415861596e-08;
    V p = k * 5.390302529957765e-15, b = a - p, q = k * 3.282003415807913e-22, y = b - q;
    V low = k * 1.2706558760139879e-29 - (((a - b) - p) + ((b - y) - q));
    y = choose(size(x) <= 843314856.5, y, all(__builtin_nan("")));
    V z = y * y, s = sine_near_zero(y, low, z), c = cosine_near_zero(y, low, z);
    V f = choose(size(m) == 1.0, c, s);
    return choose(size(m - 0.5) < 1.0, f, -f);
}

INLINE V side_of(V turns) { return 1.0 - 4.0 * size(turns - ((turns + ROUND) - ROUND)); }

// State of a block: index, q, turns, v, status, initial, work, each of `block` numbers. Rows of `info`, `across` apart:
// time, angle, velocity, kinetic, potential and total energy, work, heat, residual.
extern "C" int step(double *state, long block, long environments, double h, double bound, const float *action,
                    float *observation, double *reward, unsigned char *terminated, unsigned char *truncated,
                    double *info, long across, double gravity_rate, double motor_rate, double inertia, double scale,
                    double omega0, double speed_limit) {
    Truths ended = {0};
    for (long i = 0; i < environments; i += TOGETHER) {
        double *s = state + i / block * 7 * block + i % block;
        V index = load(s), q = load(s + block), turns = load(s + 2 * block), v = load(s + 3 * block);
        V status = load(s + 4 * block), initial = load(s + 5 * block), work = load(s + 6 * block);
        V control = actions(action + i), side = side_of(turns);

        V pull = -gravity_rate * side, torque = control * motor_rate;
        V a1 = pull * sine(q) + torque, v2 = v + h * (0.5 * a1);
        V a2 = pull * sine(q + h * (0.5 * v)) + torque, v3 = v + h * (0.5 * a2);
        V a3 = pull * sine(q + h * (0.5 * v2)) + torque, v4 = v + h * a3;
        V a4 = pull * sine(q + h * v3) + torque;
        const double sixth = 0.16666666666666666, third = 0.3333333333333333;
        V q1 = q + h * (sixth * v + third * v2 + third * v3 + sixth * v4);
        V v1 = v + h * (sixth * a1 + third * a2 + third * a3 + sixth * a4);
        V more = h * (sixth * (v * torque) + third * (v2 * torque) + third * (v3 * torque) + sixth * (v4 * torque));
        M good = (size(v1) <= 1e150) & (size(q1) <= 8e8) & (size(more) <= 1e150);
        V halves = (q1 * 0.3183098861837907 + ROUND) - ROUND;
        q1 = ((q1 - halves * 3.141592651605606) - halves * 1.9841871583270443e-09) - halves * 1.034036596358821e-18;
        V stop = choose(good, choose(size(v1) > speed_limit, all(2.0), all(0.0)), all(1.0));
        M live = status == 0.0;
        good = live & (stop != 1.0);
        q = choose(good, q1, q);
        turns = choose(good, turns + 0.5 * halves, turns);
        v = choose(good, v1, v);
        work = choose(good, work + more, work);
        index = index + choose(good, all(1.0), all(0.0));
        status = choose(live, stop, status);

        side = side_of(turns);
        V y = 0.5 * q, z = y * y, half = sine_near_zero(y, all(0.0), z);
        V limit = all(3.4028234663852886e+38), rate = choose(v < limit, v, limit);
        rate = choose(rate > -3.4028234663852886e+38, rate, -limit);
        store_rows(observation + 3 * i, side * (1.0 - 2.0 * half * half),
                   side * (2.0 * half * cosine_near_zero(y, all(0.0), z)), rate);
        V kinetic = inertia * (0.5 * v * v);
        V potential = inertia * (gravity_rate * ((1.0 - side) + side * (2.0 * half * half)));
        V energy = kinetic + potential, done = inertia * work;
        initial = choose(index == 0.0, energy, initial);
        V residual = (energy - initial) - done + 0.0;
        M late = index + choose(status == 1.0, all(1.0), all(0.0)) > all(bound);
        M lost = (size(residual) > 100.0 * (scale + size(initial) + size(done))) & (status <= 3.0);
        status = choose(lost, all(1.0), status);
        V phi = choose(side < 0.0, q, choose(q > 0.0, q - 3.141592653589793, q + 3.141592653589793));
        V speed = v / all(omega0);
        store(reward + i, -(phi * phi + 0.1 * speed * speed + 0.001 * control * control));
        ended |= store(terminated + i, status != 0.0) | store(truncated + i, late);

        V kept[] = {index, q, turns, v, choose(late & (status == 0.0), all(5.0), status), initial, work};
        for (int k = 0; k < 7; k++) store(s + k * block, kept[k]);
        V told[] = {index * h, q + 6.283185307179586 * turns, v, kinetic, potential, energy, done, all(0.0), residual};
        for (int k = 0; k < 9; k++) store(info + k * across + i, told[k]);
    }
    for (int k = 0; k < WIDTH; k++) if (ended[k]) return 1;
    return 0;
}
