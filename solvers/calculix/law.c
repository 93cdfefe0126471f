/* The hypoelastic orthotropic law as a CalculiX material: *MATERIAL, NAME=@BUBBLEFIT_HYPOELASTIC
 * (several in one deck: @BUBBLEFIT_HYPOELASTIC@BODY, ...). The in-plane law is that of
 * materials/point_law.py and point_moduli.py, function by function;
 * tests/solvers/calculix/test_calculix_law.py compares the two.
 *
 * One increment goes from the committed state (*DEPVAR) to the end of the increment:
 *   F -> C = F'F in the material frame -> log strain -> d sigma = D d eps (moduli: `modulus`)
 *     -> S = J2^power U^-1 sigma U^-1 and dS/dE (CalculiX takes the symmetric part only).
 * The normal direction and the transverse shears are linear and do not couple (nu13 = nu23 = 0),
 * so that an expanded shell behaves in its plane as the membrane does and keeps its thickness.
 * CalculiX gives and takes everything in global axes, with an *ORIENTATION or without. *STEP
 * needs NLGEOM.
 */
#define _POSIX_C_SOURCE 200809L
#include <dirent.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { /* *USER MATERIAL: the order of library.py */
    NU12 = 0,
    AREA_POWER = 1,     /* 1 constant thickness, 0 incompressible */
    NORMAL_MODULUS = 2,
    TRANSVERSE_SHEAR = 3,
    ANGLE = 4,          /* degrees from the first in-plane axis to warp, about the normal */
    NORMAL_AXIS = 5,    /* 3: axes 1, 2 in plane (warp from 1); 1: cylindrical (warp from 3) */
    WHOLE_TIMES = 6,    /* 1: the state is committed only where the total time is a whole number;
                           -n: so up to the total time n, then at every increment; 0: at every one */
    LAW = 7,            /* number of the law: of the file *.law where ccx runs that says it */
    LAW_PIECES = 8,     /* how many pieces E1, E2 and G12 have together there */
    CONSTANTS = 9
};
enum { STATES = 6 };    /* *DEPVAR: eps1, eps2, gamma12, sigma1, sigma2, tau12 (material frame) */

static const double SMALLER_INCREMENT = 0.5;
static const double TINY = 1e-12; /* an increment across the end of a piece: not divided by */

static double dot(const double *a, const double *b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double *a, const double *b, double *c) {
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

/* a without its part along the unit vector n, at unit length. */
static void unit_across(double *a, const double *n) {
    double along = dot(a, n);
    for (int i = 0; i < 3; i++) a[i] -= along * n[i];
    double length = sqrt(dot(a, a));
    for (int i = 0; i < 3; i++) a[i] /= length;
}

/* Axes (rows) of an *ORIENTATION, as transformatrix.f: cylindrical is radial, hoop, axial. */
static void local_axes(const double *orab, const double *point, double axes[3][3]) {
    const double nothing[3] = {0, 0, 0};
    if (orab[6] > 0) {
        for (int i = 0; i < 3; i++) axes[0][i] = orab[i], axes[1][i] = orab[3 + i];
        unit_across(axes[0], nothing);
        unit_across(axes[1], axes[0]);
        cross(axes[0], axes[1], axes[2]);
    } else {
        for (int i = 0; i < 3; i++) {
            axes[0][i] = point[i] - orab[i];
            axes[2][i] = orab[3 + i] - orab[i];
        }
        unit_across(axes[2], nothing);
        unit_across(axes[0], axes[2]);
        cross(axes[2], axes[0], axes[1]);
    }
}

/* Rows of a: warp, fill, normal, in global axes. */
static void material_axes(const double *k, int orientation, const double *orab,
                          const double *point, double a[3][3]) {
    double axes[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    if (orientation > 0) local_axes(orab + 7 * (orientation - 1), point, axes);
    double turn = k[ANGLE] * acos(-1.0) / 180.0, c = cos(turn), s = sin(turn);
    int cylindrical = k[NORMAL_AXIS] < 2;
    for (int i = 0; i < 3; i++) { /* (axial, -hoop, radial) is right-handed, like (1, 2, 3) */
        double first = cylindrical ? axes[2][i] : axes[0][i];
        double second = cylindrical ? -axes[1][i] : axes[1][i];
        a[0][i] = c * first + s * second;
        a[1][i] = c * second - s * first;
        a[2][i] = cylindrical ? axes[0][i] : axes[2][i];
    }
}

/* f(z) = atanh(sqrt z)/sqrt z and its derivative; the series avoids 0/0 near z = 0. */
static double atanh_ratio(double z, double *slope) {
    if (z < 0.01) {
        double f = 0, d = 0;
        for (int n = 7; n >= 1; n--) f = f * z + 1.0 / (2 * n + 1), d = d * z + n / (2.0 * n + 1);
        *slope = d;
        return 1.0 + z * f;
    }
    double s = sqrt(z), f = atanh(s) / s;
    *slope = (1.0 / (1.0 - z) - f) / (2.0 * z);
    return f;
}

/* Log strain h and p = dh/dE from m = (C11 + C22)/2, q = (C11 - C22)/2, c = C12. */
static int log_strain(double m, double q, double c, double *h, double p[3][3]) {
    double r = q * q + c * c, det = m * m - r, f1;
    if (!(m > 1e-20 && m < 1e20 && det > 1e-9 * m * m)) return 0;
    double f = atanh_ratio(r / (m * m), &f1);
    double b = f / m, b_r = f1 / (m * m * m), b_m = -f / (m * m) - 2 * r * f1 / (m * m * m * m);
    double a = 0.5 * log(det);
    h[0] = 0.5 * (a + b * q);
    h[1] = 0.5 * (a - b * q);
    h[2] = b * c;
    double a_m = m / det, a_q = -q / det, a_c = -c / det, b_q = 2 * q * b_r, b_c = 2 * c * b_r;
    double u_m = b_m * q, u_q = b + q * b_q, u_c = q * b_c;
    p[0][0] = 0.5 * (a_m + u_m + a_q + u_q);
    p[0][1] = 0.5 * (a_m + u_m - a_q - u_q);
    p[0][2] = 0.5 * (a_c + u_c);
    p[1][0] = 0.5 * (a_m - u_m + a_q - u_q);
    p[1][1] = 0.5 * (a_m - u_m - a_q + u_q);
    p[1][2] = 0.5 * (a_c - u_c);
    p[2][0] = c * (b_m + b_q);
    p[2][1] = c * (b_m - b_q);
    p[2][2] = b + c * b_c;
    return 1;
}

/* A tangent modulus: a cubic of its own strain in each piece (row: upper end, which belongs to the
 * piece, and coefficients, highest power of the strain first). Below zero strain and beyond the
 * last end it is held. `even`: G12, of the size of its strain. */
enum { A_PIECE = 5, MOST_PIECES = 100000 };
typedef struct {
    double (*piece)[A_PIECE];
    int count, even;
} Curve;

/* Of E1 and E2 by their load ratios; then T1, T2 and S of crimp, without it zero; MPa. */
enum { GAIN1, GAIN2, CRIMP1, CRIMP2, BED, COUPLINGS };

/* E1 of eps1, E2 of eps2, G12 of gamma12, and how the yarns act on each other. */
typedef struct Law {
    double number;
    Curve curve[3];
    double coupling[COUPLINGS];
    struct Law *next;
} Law;

/* The law of a file (law_file.py) if it has this number. */
static Law *read_law(const char *name, double number) {
    FILE *file = fopen(name, "r");
    double found;
    int counts[3], all = 0;
    Law *law = 0;
    if (!file) return 0;
    int good = fscanf(file, "bubblefit law %lf", &found) == 1 && found == number;
    for (int i = 0; i < 3 && good; i++) {
        good = fscanf(file, "%d", counts + i) == 1 && counts[i] > 0 && counts[i] < MOST_PIECES;
        if (good) all += counts[i];
    }
    double(*rows)[A_PIECE] = good ? malloc(sizeof *rows * (size_t)all) : 0;
    for (int i = 0; rows && i < A_PIECE * all; i++)
        good = good && fscanf(file, "%lf", rows[0] + i) == 1;
    double coupling[COUPLINGS] = {0};
    for (int i = 0; i < COUPLINGS && fscanf(file, "%lf", coupling + i) == 1;) i++;
    fclose(file);
    if (good && rows) law = malloc(sizeof *law);
    if (!law) {
        free(rows);
        return 0;
    }
    law->number = number, law->next = 0;
    memcpy(law->coupling, coupling, sizeof coupling);
    for (int i = 0; i < 3; rows += counts[i++]) {
        Curve c = {rows, counts[i], i == 2};
        law->curve[i] = c;
    }
    return law;
}

/* The law of this number, read when it is first asked for; ccx calls from several threads. */
static const Law *law_of(double number) {
    static pthread_mutex_t guard = PTHREAD_MUTEX_INITIALIZER;
    static Law *laws;
    pthread_mutex_lock(&guard);
    Law *law = laws;
    while (law && law->number != number) law = law->next;
    DIR *folder = law ? 0 : opendir(".");
    for (struct dirent *entry; folder && !law && (entry = readdir(folder));) {
        const char *end = strrchr(entry->d_name, '.');
        if (!end || strcmp(end, ".law") || !(law = read_law(entry->d_name, number))) continue;
        law->next = laws, laws = law;
    }
    if (folder) closedir(folder);
    pthread_mutex_unlock(&guard);
    return law;
}

/* The piece that holds at x; the last one beyond the range, the first below zero. */
static int piece_at(Curve c, double x) {
    int i = 0;
    while (i < c.count - 1 && x > c.piece[i][0]) i++;
    return i;
}

static double mean_of_piece(const double *p, double a, double b) {
    double total = a + b, squares = a * a + b * b;
    double value = p[1] * (0.25 * total * squares) + p[2] * ((squares + a * b) * (1.0 / 3.0));
    return value + p[3] * (0.5 * total) + p[4];
}

static double at_point(Curve c, double x) {
    double size = c.even ? fabs(x) : x, held = fmin(fmax(size, 0), c.piece[c.count - 1][0]);
    const double *p = c.piece[piece_at(c, held)];
    return ((p[1] * held + p[2]) * held + p[3]) * held + p[4];
}

/* Integral of the modulus from low to high, the sum over the pieces on the way. */
static double integral(Curve c, double low, double high) {
    double total = 0, start = 0;
    if (low < 0) total += (fmin(high, 0) - low) * c.piece[0][4];
    for (int i = 0; i < c.count; i++) {
        double end = c.piece[i][0], a = fmax(low, start), b = fmin(high, end);
        if (b > a) total += (b - a) * mean_of_piece(c.piece[i], a, b);
        start = end;
    }
    if (high > start) total += (high - fmax(low, start)) * at_point(c, start);
    return total;
}

/* A modulus over one increment, and its slope by the strain at the end of it. */
typedef struct {
    double value, slope;
} Modulus;

/* As `modulus`, for an increment that leaves a piece. */
static Modulus across(Curve c, double x, double x_old) {
    double change = x - x_old, whole;
    Modulus m = {at_point(c, 0.5 * (x + x_old)), 0};
    if (fabs(change) < TINY) return m;
    double a = c.even ? fabs(x) : x, b = c.even ? fabs(x_old) : x_old;
    if (c.even && x * x_old < 0)
        whole = integral(c, 0, a) + integral(c, 0, b);
    else
        whole = integral(c, fmin(a, b), fmax(a, b));
    m.value = whole / fabs(change);
    m.slope = (at_point(c, x) - m.value) / change;
    return m;
}

/* The mean of a modulus over the increment, (F(x) - F(x_old))/(x - x_old) with F its integral,
 * and its slope by x, (E(x) - mean)/(x - x_old). Inside one piece both are polynomials of the two
 * strains: nothing cancels, however small the increment. */
static Modulus modulus(Curve c, double x, double x_old) {
    int mirrored = c.even && x <= 0 && x_old <= 0;
    double a = mirrored ? -x_old : x_old, b = mirrored ? -x : x;
    double low = fmin(a, b), high = fmax(a, b);
    Modulus m = {c.piece[0][4], 0};
    if (!c.even && high <= 0) return m;
    int i = piece_at(c, high);
    const double *p = c.piece[i];
    if (!(low >= (i > 0 ? c.piece[i - 1][0] : 0) && high <= p[0])) return across(c, x, x_old);
    m.value = mean_of_piece(p, a, b);
    double ahead = p[1] * (0.25 * (a * a + 2 * a * b + 3 * b * b));
    ahead += p[2] * ((a + 2 * b) * (1.0 / 3.0));
    m.slope = (mirrored ? -1 : 1) * (ahead + 0.5 * p[3]);
    return m;
}

/* The stiffness along the yarns, its derivatives by E1 and E2, and how the stress depends on
 * itself: a change r at fixed ratio and exchange is a change `ahead` r of it altogether. */
typedef struct {
    double d11, d12, d22, d11_warp, d11_fill, d22_warp, d22_fill, dh[2], ahead[2][2];
} Plane;

/* 0 when a modulus or 1 - nu12 nu21 is not positive. */
static int stiffness_of(double warp, double fill, double nu, Plane *p) {
    if (!(fill > 0 && warp > 0)) return 0;
    double ratio = nu * nu / warp, den = 1 - ratio * fill;
    if (!(den > 1e-3)) return 0;
    p->d11 = warp / den, p->d22 = fill / den, p->d12 = nu * p->d22;
    p->d11_warp = (1 - 2 * ratio * fill) / (den * den), p->d11_fill = nu * nu / (den * den);
    p->d22_warp = -ratio * fill * fill / warp / (den * den), p->d22_fill = 1 / (den * den);
    return 1;
}

/* Angle of the load ratio of two stresses and its derivatives, point_law.py `load_angle`. */
static double load_angle(double warp, double fill, double by[2]) {
    double square = warp * warp + fill * fill, right = 0.5 * acos(-1.0);
    by[0] = by[1] = 0;
    if (warp > 0 || fill > 0) {
        if (warp <= 0) return right;
        if (fill <= 0) return 0;
        if (square > 0) by[0] = -fill / square, by[1] = warp / square;
        return atan2(fill, warp);
    }
    if (square == 0) return 0.5 * right;
    by[0] = fill / square, by[1] = -warp / square;
    return atan2(-warp, -fill);
}

/* Moduli at the load ratio of the increment's mean stress; point_law.py `mean_ratio`. */
static int at_mean_ratio(const double *k, double *warp, double *fill, double nu,
                         const double *old, Plane *p) {
    const double even = sqrt(0.5), right = 0.5 * acos(-1.0), *dh = p->dh;
    double unused[2], angle = load_angle(old[0], old[1], unused), low = 0, high = right;
    double e1 = 0, e2 = 0, turn = 0, u[2] = {0}, w[2] = {0};
    for (int i = 0; i < 60; i++) {
        double c = cos(angle), s = sin(angle);
        e1 = *warp + k[GAIN1] * (c - even), e2 = *fill + k[GAIN2] * (s - even);
        if (!stiffness_of(e1, e2, nu, p)) return 0;
        double by1 = -k[GAIN1] * s, by2 = k[GAIN2] * c;
        double d11_by = p->d11_warp * by1 + p->d11_fill * by2;
        double d22_by = p->d22_warp * by1 + p->d22_fill * by2;
        u[0] = 0.5 * (d11_by * dh[0] + nu * d22_by * dh[1]);
        u[1] = 0.5 * (nu * d22_by * dh[0] + d22_by * dh[1]);
        double at = load_angle(old[0] + 0.5 * (p->d11 * dh[0] + p->d12 * dh[1]),
                               old[1] + 0.5 * (p->d12 * dh[0] + p->d22 * dh[1]), w);
        turn = 1 - (w[0] * u[0] + w[1] * u[1]);
        double off = at - angle;
        if (fabs(off) <= 1e-15 || off != off) break;
        *(off > 0 ? &low : &high) = angle;
        double next = turn > 0 ? angle + off / turn : -1;
        if (!(low < next && next < high)) {
            int end = (at == 0 || at == right) && low <= at && at <= high;
            next = end ? at : 0.5 * (low + high);
        }
        if (fabs(next - angle) <= 1e-15) break;
        angle = next;
    }
    if (!(turn > 0)) return 0;
    for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++) p->ahead[i][j] = (i == j) + u[i] * w[j] / turn;
    *warp = e1, *fill = e2;
    return 1;
}

/* Exchange of crimp w at two stresses, and its derivatives; point_law.py `_exchanged`. */
static double exchanged(const double *s, double r1, double r2, double bed, double by[2]) {
    double whole = bed + s[0] + s[1], pull = fmax(whole, 0.5 * bed), free = whole >= 0.5 * bed;
    double w = (r1 * s[0] - r2 * s[1]) / pull;
    by[0] = (r1 - free * w) / pull, by[1] = -(r2 + free * w) / pull;
    if (w < r1 && w > -r2) return w;
    by[0] = by[1] = 0;
    return w >= r1 ? r1 : -r2;
}

/* Stress after an increment with crimp, and the yarns' part of it; point_law.py `exchange`. */
static int exchange(const double *k, const double *old, double *s, Plane *p) {
    double bed = k[BED], r1 = k[CRIMP1] / bed, r2 = k[CRIMP2] / bed, by[2], e[2] = {0};
    if (!(bed > 0)) return 0;
    double before = exchanged(old, r1, r2, bed, by), w = before, low = -r2, high = r1;
    for (int i = 0; i < 60; i++) {
        e[0] = p->dh[0] - (2 * r1 - w) * w + (2 * r1 - before) * before;
        e[1] = p->dh[1] + (2 * r2 + w) * w - (2 * r2 + before) * before;
        s[0] = old[0] + p->d11 * e[0] + p->d12 * e[1];
        s[1] = old[1] + p->d12 * e[0] + p->d22 * e[1];
        double whole = bed + s[0] + s[1], pull = fmax(whole, 0.5 * bed);
        double free = whole >= 0.5 * bed, off = w * pull - r1 * s[0] + r2 * s[1];
        if (off != off) return 0;
        if ((w == r1 && off <= 0) || (w == -r2 && off >= 0)) break;
        *(off > 0 ? &high : &low) = w;
        double dg0 = p->d11 * (r1 - w) - p->d12 * (r2 + w);
        double dg1 = p->d12 * (r1 - w) - p->d22 * (r2 + w);
        double steep = pull + 2 * ((r1 - free * w) * dg0 - (r2 + free * w) * dg1);
        double next = steep > 0 ? w - off / steep : INFINITY;
        if (!(low < next && next < high)) {
            double beyond = next >= high ? r1 : -r2;
            next = beyond == low || beyond == high ? beyond : 0.5 * (low + high);
        }
        if (fabs(next - w) <= 1e-15) break;
        w = next;
    }
    exchanged(s, r1, r2, bed, by);
    if (w == r1 || w == -r2) by[0] = by[1] = 0;
    double g[2] = {2 * (r1 - w), -2 * (r2 + w)}, dg[2];
    dg[0] = p->d11 * g[0] + p->d12 * g[1], dg[1] = p->d12 * g[0] + p->d22 * g[1];
    double whole = 1 + by[0] * dg[0] + by[1] * dg[1];
    if (!(whole > 0)) return 0;
    for (int i = 0; i < 2; i++) {
        p->dh[i] = e[i];
        for (int j = 0; j < 2; j++) p->ahead[i][j] = (i == j) - dg[i] * by[j] / whole;
    }
    return 1;
}

/* s = s_old + D (h - h_old) and d = ds/dh; 0 when a modulus or 1 - nu12 nu21 is not positive. */
static int stress_update(const Law *law, double nu, const double *h, const double *h_old,
                         const double *s_old, double *s, double d[3][3]) {
    const Curve *curve = law->curve;
    const double *k = law->coupling;
    Modulus e1 = modulus(curve[0], h[0], h_old[0]), e2 = modulus(curve[1], h[1], h_old[1]);
    Modulus g12 = modulus(curve[2], h[2], h_old[2]);
    double warp = e1.value, fill = e2.value, shear = g12.value;
    double slope1 = e1.slope, slope2 = e2.slope, slope3 = g12.slope;
    Plane p = {.dh = {h[0] - h_old[0], h[1] - h_old[1]}, .ahead = {{1, 0}, {0, 1}}};
    if (!(shear > 0)) return 0;
    if ((k[GAIN1] != 0 || k[GAIN2] != 0) && !at_mean_ratio(k, &warp, &fill, nu, s_old, &p))
        return 0;
    if (!stiffness_of(warp, fill, nu, &p)) return 0;
    s[0] = s_old[0] + p.d11 * p.dh[0] + p.d12 * p.dh[1];
    s[1] = s_old[1] + p.d12 * p.dh[0] + p.d22 * p.dh[1];
    if (k[BED] != 0 && !exchange(k, s_old, s, &p)) return 0;
    const double *dh = p.dh;
    s[2] = s_old[2] + shear * (h[2] - h_old[2]);
    d[0][0] = p.d11 + slope1 * (p.d11_warp * dh[0] + nu * p.d22_warp * dh[1]);
    d[0][1] = p.d12 + slope2 * (p.d11_fill * dh[0] + nu * p.d22_fill * dh[1]);
    d[1][0] = p.d12 + slope1 * (nu * p.d22_warp * dh[0] + p.d22_warp * dh[1]);
    d[1][1] = p.d22 + slope2 * (nu * p.d22_fill * dh[0] + p.d22_fill * dh[1]);
    for (int j = 0; j < 2; j++) {
        double first = d[0][j], second = d[1][j];
        for (int i = 0; i < 2; i++) d[i][j] = p.ahead[i][0] * first + p.ahead[i][1] * second;
    }
    d[2][2] = shear + slope3 * (h[2] - h_old[2]);
    d[0][2] = d[1][2] = d[2][0] = d[2][1] = 0;
    return 1;
}

/* s = U^-1 t U^-1 with U^-1 = k [[C22 + J, -C12], [-C12, C11 + J]], k = 1/(J sqrt(tr C + 2 J));
 * w = ds/dt, g = ds/dE at fixed t. */
static void pull_back(double m, double q, double c, const double *t, double *s, double w[3][3],
                      double g[3][3]) {
    double j = sqrt(m * m - q * q - c * c), root = sqrt(2 * (m + j)), k = 1 / (root * j);
    double a = m - q + j, b = m + q + j, w1 = k * a, w2 = k * b, w3 = -k * c;
    w[0][0] = w1 * w1, w[0][1] = w3 * w3, w[0][2] = 2 * w1 * w3;
    w[1][0] = w3 * w3, w[1][1] = w2 * w2, w[1][2] = 2 * w3 * w2;
    w[2][0] = w1 * w3, w[2][1] = w3 * w2, w[2][2] = w1 * w2 + w3 * w3;
    for (int i = 0; i < 3; i++) {
        s[i] = dot(w[i], t);
        double dm = i < 2, dq = i == 0 ? 1 : i == 1 ? -1 : 0, dc = i == 2;
        double dj = (m * dm - q * dq - c * dc) / j;
        double dk = -k * ((dm + dj) / (root * root) + dj / j);
        double d1 = k * (dm - dq + dj) + a * dk, d2 = k * (dm + dq + dj) + b * dk;
        double d3 = -k * dc - c * dk, d13 = d1 * w3 + w1 * d3, d32 = d3 * w2 + w3 * d2;
        g[0][i] = 2 * (w1 * d1 * t[0] + d13 * t[2] + w3 * d3 * t[1]);
        g[1][i] = 2 * (w3 * d3 * t[0] + d32 * t[2] + w2 * d2 * t[1]);
        g[2][i] = d13 * t[0] + (d1 * w2 + w1 * d2 + 2 * w3 * d3) * t[2] + d32 * t[1];
    }
}

/* In-plane S = (S11, S22, S12), g = dS/dE with engineering shear, and the new state. */
static int membrane_stress(const Law *law, const double *k, double c11, double c22, double c12,
                           const double *old, double *state, double *s, double g[3][3]) {
    double m = 0.5 * (c11 + c22), q = 0.5 * (c11 - c22), p[3][3], d[3][3], w[3][3], t[3];
    double *h = state, *sigma = state + 3;
    if (!log_strain(m, q, c12, h, p)) return 0;
    if (!stress_update(law, k[NU12], h, old, old + 3, sigma, d)) return 0;
    double power = k[AREA_POWER], ratio = exp(power * (h[0] + h[1]));
    for (int i = 0; i < 3; i++) t[i] = ratio * sigma[i];
    pull_back(m, q, c12, t, s, w, g);
    for (int i = 0; i < 3; i++) { /* the area ratio grows with both normal strains */
        d[i][0] = ratio * (d[i][0] + power * sigma[i]);
        d[i][1] = ratio * (d[i][1] + power * sigma[i]);
        d[i][2] *= ratio;
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int n = 0; n < 3; n++)
                g[i][j] += w[i][n] * (d[n][0] * p[0][j] + d[n][1] * p[1][j] + d[n][2] * p[2][j]);
    return 1;
}

/* Interface: umat_user.f in the CalculiX sources. xkl is column by column; components are
 * 11 22 33 12 13 23; stiff is the upper triangle of dS/dE, column by column. */
void HYPOELASTIC(const char *amat, const int *iel, const int *iint, const int *kode,
                 const double *constants, const double *emec, const double *emec0,
                 const double *beta, const double *xokl, const double *voj, const double *xkl,
                 const double *vj, const int *ithermal, const double *t1l, const double *dtime,
                 const double *time, const double *ttime, const int *icmd, const int *ielas,
                 const int *mi, const int *nstate, const double *xstateini, double *xstate,
                 double *stre, double *stiff, const int *iorien, const double *pgauss,
                 const double *orab, double *pnewdt, const int *ipkon, const int size) {
    static const int I[6] = {0, 1, 2, 0, 0, 1}, J[6] = {0, 1, 2, 1, 2, 2}, PLANE[3] = {0, 1, 3};
    (void)amat, (void)emec, (void)emec0, (void)beta, (void)xokl, (void)voj, (void)vj;
    (void)ithermal, (void)t1l, (void)dtime, (void)ielas, (void)ipkon;
    (void)size;
    const double *const k = constants, e3 = k[NORMAL_MODULUS], g3 = k[TRANSVERSE_SHEAR];
    int given = -100 - *kode;
    if (given != CONSTANTS || *nstate < STATES) {
        printf(" *ERROR in HYPOELASTIC: %d constants and *DEPVAR %d are needed, not %d and %d\n",
               CONSTANTS, STATES, given, *nstate);
        exit(201);
    }
    const Law *law = law_of(k[LAW]);
    if (!law || law->curve[0].count + law->curve[1].count + law->curve[2].count != k[LAW_PIECES]) {
        printf(" *ERROR in HYPOELASTIC: no file *.law in the folder of the deck has the law %.0f "
               "of %.0f pieces\n", k[LAW], k[LAW_PIECES]);
        exit(201);
    }
    size_t place = (size_t)*nstate * ((size_t)mi[0] * (*iel - 1) + (*iint - 1));
    const double *old = xstateini + place;
    double a[3][3], f[3][3], state[STATES] = {0}, plane[3], g[3][3];
    double local[6] = {0}, c[6][6] = {{0}}, turn[6][6];
    material_axes(k, *iorien, orab, pgauss, a);
    for (int n = 0; n < 3; n++) /* images of the material axes */
        for (int i = 0; i < 3; i++)
            f[n][i] = xkl[i] * a[n][0] + xkl[i + 3] * a[n][1] + xkl[i + 6] * a[n][2];
    double c11 = dot(f[0], f[0]), c22 = dot(f[1], f[1]), c12 = dot(f[0], f[1]);
    int good = membrane_stress(law, k, c11, c22, c12, old, state, plane, g);
    double normal = 0.5 * (dot(f[2], f[2]) - 1);
    double shear1 = dot(f[0], f[2]), shear2 = dot(f[1], f[2]);
    good = good && isfinite(normal) && isfinite(shear1) && isfinite(shear2);
    /* With one *STEP of length 1 for every increment of the law, the strain path does not depend on
     * how many increments CalculiX needed in between (cut-back in the membrane solver likewise). */
    double now = *time + *ttime, whole = k[WHOLE_TIMES];
    int only_whole = whole > 0 || now < -whole;
    int commit = good && !(only_whole && fabs(now - round(now)) > 1e-9);
    for (int i = 0; i < STATES; i++) xstate[place + i] = commit ? state[i] : old[i];
    if (!good) { /* stre stays what it was; the stiffness only has to be harmless */
        if (!(*pnewdt > 0 && *pnewdt < SMALLER_INCREMENT)) *pnewdt = SMALLER_INCREMENT;
        for (int i = 0; i < 21; i++) stiff[i] = 0;
        for (int i = 0, n = 0; i < 6; n += ++i + 1) stiff[n] = i < 3 ? e3 : g3;
        return;
    }
    for (int i = 0; i < 3; i++) {
        local[PLANE[i]] = plane[i];
        for (int j = 0; j < 3; j++) c[PLANE[i]][PLANE[j]] = 0.5 * (g[i][j] + g[j][i]);
    }
    local[2] = e3 * normal, local[4] = g3 * shear1, local[5] = g3 * shear2;
    c[2][2] = e3, c[4][4] = c[5][5] = g3;
    /* Local engineering strain = turn . global one; S turns back by its transpose. */
    for (int m = 0; m < 6; m++)
        for (int n = 0; n < 6; n++) {
            turn[m][n] = a[I[m]][I[n]] * a[J[m]][J[n]];
            if (m > 2) turn[m][n] += a[J[m]][I[n]] * a[I[m]][J[n]];
        }
    for (int n = 0; n < 6; n++) {
        stre[n] = 0;
        for (int m = 0; m < 6; m++) stre[n] += turn[m][n] * local[m];
    }
    if (*icmd == 3) return;
    for (int j = 0, n = 0; j < 6; j++)
        for (int i = 0; i <= j; i++, n++) {
            stiff[n] = 0;
            for (int m = 0; m < 6; m++)
                for (int l = 0; l < 6; l++) stiff[n] += turn[m][i] * c[m][l] * turn[l][j];
        }
}
