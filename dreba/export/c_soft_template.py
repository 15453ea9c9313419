"""Template of the C source of soft tables: value, gradient and Gauss-Newton factor of one pose."""

from __future__ import annotations

from typing import Final

PARTS_KEPT: Final = """\
        double kept[9];
        for (int k = 0; k < 9; ++k) kept[k] = fmax(part[k], 0.0);
"""
GAUSS_NEWTON: Final = """\
        if (factor) {
            double by[17][$d + 1] = {{0.0}}, weight[9];
            for (int r = 0; r < $rows; ++r)
                by[group_of[r]][column[r]] += height[r] * (1.0 - step[r] * step[r]) * scale[r];
            for (int g = 0; g < 17; ++g) {
                by[g][$knee] += by[g][$d] * knee_left;
                by[g][$knee + 1] += by[g][$d] * (1.0 - knee_left);
            }
            for (int k = 0; k < 9; ++k) weight[k] = sqrt(fmax(part[k], 0.0) / (2.0 * (kept[k] + $residual)));
            for (int c = 0; c < $d; ++c) {
                for (int k = 0; k < 4; ++k)
                    factor[paired[k] * $d + c] = weight[paired[k]] * (by[k][c]
                        + (1.0 - overlap[k] * group[8 + k]) * by[4 + k][c]
                        + (1.0 - overlap[k] * group[4 + k]) * by[8 + k][c]);
                for (int k = 0; k < 5; ++k) factor[single[k] * $d + c] = weight[single[k]] * by[12 + k][c];
            }
        }
"""
SOFT: Final = """\
static const double ${name}_table_a[60] = $a;
static const double ${name}_table_b[36] = $b;
static const double ${name}_table_c[144] = $c;

static double ${name}_smooth_max(double left, double right, double width, double *by_left)
{
    const double difference = left - right, root = sqrt(difference * difference + width * width);
    *by_left = 0.5 + 0.5 * difference / root;
    return 0.5 * (left + right + root - width);
}

/* Place in a cell (0 to 1); *inside is 0 where the table ends. */
static int ${name}_cell_of(double score, int last, double *place, double *inside)
{
    const double held = fmin(fmax(score, 0.0), (double)last);
    int corner = (int)held;
    if (corner > last - 1) corner = last - 1;
    *inside = held == score;
    *place = held - corner;
    return corner;
}

/* Trilinear interpolation in table (.., n1, n2) at scores from 0; slopes by the three scores. */
static double ${name}_trilinear(const double *table, const int last[3], const double score[3], double slope[3])
{
    double p[3], inside[3];
    int corner[3];
    for (int k = 0; k < 3; ++k) corner[k] = ${name}_cell_of(score[k], last[k], &p[k], &inside[k]);
    const int s1 = last[2] + 1, s0 = (last[1] + 1) * s1;
    const double *v = table + corner[0] * s0 + corner[1] * s1 + corner[2];
    const double v00 = v[0] + p[2] * (v[1] - v[0]), v01 = v[s1] + p[2] * (v[s1 + 1] - v[s1]);
    const double v10 = v[s0] + p[2] * (v[s0 + 1] - v[s0]);
    const double v11 = v[s0 + s1] + p[2] * (v[s0 + s1 + 1] - v[s0 + s1]);
    const double low = v00 + p[1] * (v01 - v00), high = v10 + p[1] * (v11 - v10);
    const double d0 = (v[1] - v[0]) + p[1] * ((v[s1 + 1] - v[s1]) - (v[1] - v[0]));
    const double d1 = (v[s0 + 1] - v[s0]) + p[1] * ((v[s0 + s1 + 1] - v[s0 + s1]) - (v[s0 + 1] - v[s0]));
    slope[0] = inside[0] * (high - low);
    slope[1] = inside[1] * ((v01 - v00) + p[0] * ((v11 - v10) - (v01 - v00)));
    slope[2] = inside[2] * (d0 + p[0] * (d1 - d0));
    return low + p[0] * (high - low);
}

static double ${name}_at(const double *angles, double load, const double *coupling, double activity, double *gradient,
                         double *factor)
{
    static const int column[$rows] = $column;
    static const int group_of[$rows] = $group;
    static const double scale[$rows] = $scale;
    static const double offset[$rows] = $offset;
    static const double height[$rows] = $height;
    static const double overlap[4] = $overlap;
    static const int paired[4] = {0, 3, 7, 8}, single[5] = {6, 1, 2, 4, 5};
    static const int last[2][3] = {{4, 2, 3}, {5, 1, 2}};
    double step[$rows], group[17] = {0.0}, part[9], score[3], slope[3][3], knee_left, side_left;
    const double knee = ${name}_smooth_max(angles[$knee], angles[$knee + 1], $knee_width, &knee_left);

    double seen[$d + 1], check = 0.0;
    for (int k = 0; k < $d; ++k) check += 0.0 * angles[k];
    for (int k = 0; k < $d; ++k) seen[k] = angles[k];
    seen[$d] = knee;
    /* exp is faster than tanh; the bounds keep it from overflowing. */
    for (int r = 0; r < $rows; ++r) step[r] = fmax(fmin(2.0 * (offset[r] - scale[r] * seen[column[r]]), 700.0), -700.0);
    for (int r = 0; r < $rows; ++r) step[r] = 2.0 / (1.0 + exp(step[r])) - 1.0;
    for (int r = 0; r < $rows; ++r) group[group_of[r]] += height[r] * (1.0 + step[r]);
    for (int k = 0; k < 4; ++k)
        part[paired[k]] = group[k] + group[4 + k] + group[8 + k] - overlap[k] * group[4 + k] * group[8 + k];
    for (int k = 0; k < 5; ++k) part[single[k]] = group[12 + k];

    for (int t = 0; t < 3; ++t) {
        const double own[3] = {part[t], part[3 + t], part[6 + t]};
        score[t] = ${name}_trilinear(t ? ${name}_table_b : ${name}_table_a, last[t > 0], own, slope[t]);
    }
    score[0] += ${name}_load_points(load);
    score[1] += coupling[0];
    score[2] += coupling[1];
    const double worse = ${name}_smooth_max(score[1], score[2], $side_width, &side_left);
    double x, y, inside_x, inside_y;
    const int i = ${name}_cell_of(score[0] - 1.0, 11, &x, &inside_x);
    const int j = ${name}_cell_of(worse - 1.0, 11, &y, &inside_y);
    const double *v = ${name}_table_c + 12 * i + j;
    const double low = v[0] + y * (v[1] - v[0]), high = v[12] + y * (v[13] - v[12]);
    if (gradient || factor) {
        const double by_a = inside_x * (high - low);
        const double by_b = inside_y * ((v[1] - v[0]) + x * ((v[13] - v[12]) - (v[1] - v[0])));
        const double by_score[3] = {by_a, by_b * side_left, by_b * (1.0 - side_left)};
        double by_group[17], by_column[$d + 1] = {0.0};
$parts_kept        for (int k = 0; k < 9; ++k) part[k] = slope[k % 3][k / 3] * by_score[k % 3];
        for (int k = 0; k < 4; ++k) {
            by_group[k] = part[paired[k]];
            by_group[4 + k] = part[paired[k]] * (1.0 - overlap[k] * group[8 + k]);
            by_group[8 + k] = part[paired[k]] * (1.0 - overlap[k] * group[4 + k]);
        }
        for (int k = 0; k < 5; ++k) by_group[12 + k] = part[single[k]];
        for (int r = 0; r < $rows; ++r)
            by_column[column[r]] += by_group[group_of[r]] * height[r] * (1.0 - step[r] * step[r]) * scale[r];
        by_column[$knee] += by_column[$d] * knee_left;
        by_column[$knee + 1] += by_column[$d] * (1.0 - knee_left);
        for (int k = 0; k < $d && gradient; ++k) gradient[k] = by_column[k];
$gauss_newton    }
    return low + x * (high - low) + activity + check;
}
"""
