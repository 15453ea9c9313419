"""Templates of the C sources: the functions of angles in degrees, without checks, and what stands around them.

Every name begins with that of the function, so that several files can be included in one. C99 that is C++17 too.
"""

from __future__ import annotations

from typing import Final

HEAD: Final = """\
/* $what. C99 and C++17, no dependencies.
 * Written by $generator.
 *
$interface
 */
#include <float.h>
#include <math.h>
#include <stddef.h>

#ifdef __cplusplus
#define restrict
extern "C" {
#endif
$prototypes
#ifdef __cplusplus
}
#endif

"""
LOAD: Final = """\
static double ${name}_load_points(double load)
{
    return (load >= $edge_1 ? 1.0 : 0.0) + (load > $edge_2 ? 1.0 : 0.0);
}

"""
INTERFACE: Final = """\
 * double $name(const double $q[$m], double load, const double coupling[2], double activity, double *gradient)
$hessian_line *   $q    $unit:
 *     $joints
$held *   load      kg
 *   coupling  left and right, 0 (good) to 3 (unacceptable)
 *   activity  points, 0 to 3
 *   gradient  $m values per $one, or NULL; must not overlap $q
$hessian_note * An input that is not finite, or a factor out of range: all results are NaN. This needs the
 * comparisons of IEEE 754: no -ffast-math, no -ffinite-math-only."""
HEADER: Final = """\
/* $what: declarations of $file.
 * Written by $generator.
 *
$interface
 */
#ifndef ${name}_H
#define ${name}_H

#define ${name}_JOINTS $m

#ifdef __cplusplus
extern "C" {
#endif
$prototypes
#ifdef __cplusplus
}
#endif

#endif
"""
PROTOTYPE: Final = (
    "double $name(const double $q[$m], double load, const double coupling[2], double activity, double *gradient);"
)
HESSIAN_PROTOTYPE: Final = (
    "void ${name}_hessian(const double $q[$m], double load, const double coupling[2], double activity, "
    "double *hessian);"
)
ODD: Final = """
    {
        const double bend = half[LAST] * angles[LAST], rise = linear[LAST] + bend;
        sum[0] += angles[LAST] * rise;
        gradient[LAST] = rise + bend;
    }"""
# Two interleaved sums let the compiler use vector registers of two doubles at -O2.
QUADRATIC: Final = """\
static double ${name}_at(const double *restrict angles, double load, const double *coupling, double activity,
                         double *restrict gradient)
{
    static const double linear[$d] = $linear;
    static const double half[$d] = $half;
    const double worse = coupling[0] > coupling[1] ? coupling[0] : coupling[1];
    double sum[2] = {0.0, 0.0};
    for (int i = 0; i < $even; i += 2)
        for (int k = 0; k < 2; ++k) {
            const double bend = half[i + k] * angles[i + k], rise = linear[i + k] + bend;
            sum[k] += angles[i + k] * rise;
            gradient[i + k] = rise + bend;
        }$odd
    return sum[0] + sum[1] + $constant + $payload + $by_activity * activity + $grip * worse;
}
"""
QUADRATIC_CURVATURE: Final = """\

static void ${name}_curvature(const double *angles, double *diagonal)
{
    static const double half[$d] = $half;
    (void)angles;
    for (int i = 0; i < $d; ++i) diagonal[i] = 2.0 * half[i];
}
"""
CONVEX_TABLES: Final = """\
static const int ${name}_start[$d + 1] = $start;
static const double ${name}_scale[$rows] = $scale;
static const double ${name}_offset[$rows] = $offset;
static const double ${name}_weight[$rows] = $weight;

"""
CONVEX: Final = """\
static double ${name}_at(const double *angles, double load, const double *coupling, double activity, double *gradient)
{
    const double worse = coupling[0] > coupling[1] ? coupling[0] : coupling[1];
    double value = $constant + $by_load * ${name}_load_points(load) + $grip * worse + activity, check = 0.0;
    for (int i = 0; i < $d; ++i) {
        double slope = 0.0;
        check += 0.0 * angles[i];
        for (int r = ${name}_start[i]; r < ${name}_start[i + 1]; ++r) {
            const double past = ${name}_scale[r] * angles[i] - ${name}_offset[r];
            if (past > 0.0) {
                const double inside = past < 1.0 ? past : 1.0;
                value += ${name}_weight[r] * inside * (past - 0.5 * inside);
                slope += ${name}_weight[r] * ${name}_scale[r] * inside;
            }
        }
        gradient[i] = slope;
    }
    return value + check;
}
"""
CONVEX_CURVATURE: Final = """\

static void ${name}_curvature(const double *angles, double *diagonal)
{
    for (int i = 0; i < $d; ++i) {
        diagonal[i] = 0.0;
        for (int r = ${name}_start[i]; r < ${name}_start[i + 1]; ++r) {
            const double past = ${name}_scale[r] * angles[i] - ${name}_offset[r];
            if (past > 0.0 && past < 1.0) diagonal[i] += ${name}_weight[r] * ${name}_scale[r] * ${name}_scale[r];
        }
    }
}
"""
# The difference is 0 for numbers and not a number for others, which every function of angles passes on to its value;
# so is the product of the factors. Minima and maxima are single instructions.
VALID: Final = """
static int ${name}_valid(double value, double load, const double *coupling, double activity)
{
    const double lower = coupling[0] < coupling[1] ? coupling[0] : coupling[1];
    const double worse = coupling[0] > coupling[1] ? coupling[0] : coupling[1];
    const double least = load < activity ? load : activity, most = worse > activity ? worse : activity;
    const double check = value - value + 0.0 * (load + coupling[0] + coupling[1] + activity);
    return (check == 0.0) & ((least < lower ? least : lower) >= 0.0) & (most <= $most);
}
"""
PLAIN: Final = """
double $name(const double angles[$d], double load, const double coupling[2], double activity, double *gradient)
{
    double unused[$d];
    if (!gradient) gradient = unused;
    const double value = ${name}_at(angles, load, coupling, activity, gradient$no_factor);
    if (${name}_valid(value, load, coupling, activity)) return value;
    for (int i = 0; i < $d; ++i) gradient[i] = NAN;
    return NAN;
}
"""
MAP: Final = """
static const double ${name}_held[$d] = $offset_of_map;
static const int ${name}_map_column[$entries] = $map_column;
static const int ${name}_map_joint[$entries] = $map_joint;
static const double ${name}_map_factor[$entries] = $map_factor;

/* Returns 0, or not a number if a joint is none. */
static double ${name}_angles(const double *joints, double *angles)
{
    double check = 0.0;
    for (int j = 0; j < $m; ++j) check += 0.0 * joints[j];
    for (int i = 0; i < $d; ++i) angles[i] = ${name}_held[i];
    for (int e = 0; e < $entries; ++e)
        angles[${name}_map_column[e]] += ${name}_map_factor[e] * joints[${name}_map_joint[e]];
    return check;
}
"""
MAPPED: Final = """
double $name(const double joints[$m], double load, const double coupling[2], double activity, double *gradient)
{
    double angles[$d], slope[$d];
    const double check = ${name}_angles(joints, angles);
    const double value = check + ${name}_at(angles, load, coupling, activity, slope$no_factor);
    const int valid = ${name}_valid(value, load, coupling, activity);
    if (gradient) {
        for (int j = 0; j < $m; ++j) gradient[j] = valid ? 0.0 : NAN;
        for (int e = 0; e < $entries && valid; ++e)
            gradient[${name}_map_joint[e]] += ${name}_map_factor[e] * slope[${name}_map_column[e]];
    }
    return valid ? value : NAN;
}
"""
# Angles -> dense Hessian by the angles; `full` is where a map needs it.
DIAGONAL: Final = """
    double diagonal[$d];
    ${name}_curvature(angles, diagonal);
    for (int i = 0; i < $d * $d; ++i) full[i] = 0.0;
    for (int i = 0; i < $d; ++i) full[i * $d + i] = diagonal[i];"""
DIRECT: Final = """
    ${name}_at(angles, load, coupling, activity, NULL, full);"""
SQUARED: Final = """
    double factor[9 * $d];
    ${name}_at(angles, load, coupling, activity, NULL, factor);
    for (int i = 0; i < $d; ++i)
        for (int j = 0; j < $d; ++j) {
            double sum = 0.0;
            for (int p = 0; p < 9; ++p) sum += factor[p * $d + i] * factor[p * $d + j];
            full[i * $d + j] = sum;
        }"""
PLAIN_HESSIAN: Final = """
void ${name}_hessian(const double angles[$d], double load, const double coupling[2], double activity, double *hessian)
{
    double slope[$d], *full = hessian;
    const double value = ${name}_at(angles, load, coupling, activity, slope$no_factor);
    if (!${name}_valid(value, load, coupling, activity)) {
        for (int i = 0; i < $d * $d; ++i) hessian[i] = NAN;
        return;
    }$fill
}
"""
MAPPED_HESSIAN: Final = """
void ${name}_hessian(const double joints[$m], double load, const double coupling[2], double activity, double *hessian)
{
    double angles[$d], slope[$d], full[$d * $d];
    const double check = ${name}_angles(joints, angles);
    const double value = check + ${name}_at(angles, load, coupling, activity, slope$no_factor);
    const int valid = ${name}_valid(value, load, coupling, activity);
    for (int i = 0; i < $m * $m; ++i) hessian[i] = valid ? 0.0 : NAN;
    if (!valid) return;$fill
    for (int e = 0; e < $entries; ++e)
        for (int f = 0; f < $entries; ++f)
            hessian[${name}_map_joint[e] * $m + ${name}_map_joint[f]] += ${name}_map_factor[e] * ${name}_map_factor[f]
                * full[${name}_map_column[e] * $d + ${name}_map_column[f]];
}
"""
FOOT: Final = """
#ifdef __cplusplus
#undef restrict
#endif
"""
