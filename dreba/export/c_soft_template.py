"""Template of the C source of soft tables: value, gradient, and on request second derivatives, of one pose."""

from __future__ import annotations

from typing import Final

PARTS_KEPT: Final = """\
        double kept[9];
        for (int k = 0; k < 9; ++k) kept[k] = fmax(part[k], 0.0);
"""
PART_SLOPES: Final = """\
            double by[17][$d + 1] = {{0.0}}, slopes[9][$d];
            for (int r = 0; r < $rows; ++r)
                by[group_of[r]][column[r]] += height[r] * (1.0 - step[r] * step[r]) * scale[r];
            for (int g = 0; g < 17; ++g) {
                by[g][$knee] += by[g][$d] * knee_left;
                by[g][$knee + 1] += by[g][$d] * (1.0 - knee_left);
            }
            for (int c = 0; c < $d; ++c) {
                for (int k = 0; k < 4; ++k)
                    slopes[paired[k]][c] = by[k][c] + (1.0 - overlap[k] * group[8 + k]) * by[4 + k][c]
                        + (1.0 - overlap[k] * group[4 + k]) * by[8 + k][c];
                for (int k = 0; k < 5; ++k) slopes[single[k]][c] = by[12 + k][c];
            }
"""
GAUSS_NEWTON: Final = f"""\
        if (second) {{
{PART_SLOPES}            for (int k = 0; k < 9; ++k) {{
                const double weight = sqrt(fmax(part[k], 0.0) / (2.0 * (kept[k] + $residual)));
                for (int c = 0; c < $d; ++c) second[k * $d + c] = weight * slopes[k][c];
            }}
        }}
"""
# H = J^T Y J + sum of the derivatives by the parts times their own Hessians: see `soft_curvature`.
EXACT: Final = f"""\
        if (second) {{
{PART_SLOPES}            const double side_bent = by_b * ${{name}}_bend(score[1] - score[2], $side_width);
            const double knee_bent = by_column[$d] * ${{name}}_bend(angles[$knee] - angles[$knee + 1], $knee_width);
            const double cross = inside_x * inside_y * (v[13] - v[12] - v[1] + v[0]);
            const double by_scores[3][3] = {{
                {{0.0, cross * side_left, cross * (1.0 - side_left)}}, {{cross * side_left, side_bent, -side_bent}},
                {{cross * (1.0 - side_left), -side_bent, side_bent}}}};
            double mixed[3][3], by_parts[9][9], bend[$d + 1] = {{0.0}};
            for (int t = 0; t < 3; ++t)
                ${{name}}_mixed(t ? ${{name}}_table_b : ${{name}}_table_a, last[t > 0], own[t], mixed[t]);
            for (int k = 0; k < 9; ++k)
                for (int m = 0; m < 9; ++m) {{
                    const int t = k % 3, u = m % 3;
                    by_parts[k][m] = slope[t][k / 3] * by_scores[t][u] * slope[u][m / 3];
                    if (t == u && k != m) by_parts[k][m] += by_score[t] * mixed[t][k / 3 + m / 3 - 1];
                }}
            for (int r = 0; r < $rows; ++r)
                bend[column[r]] -= 2.0 * by_group[group_of[r]] * height[r] * scale[r] * scale[r] * step[r]
                    * (1.0 - step[r] * step[r]);
            for (int c = 0; c < $d; ++c)
                for (int e = 0; e < $d; ++e) {{
                    double sum = c == e ? bend[c] : 0.0;
                    for (int k = 0; k < 9; ++k)
                        for (int m = 0; m < 9; ++m) sum += slopes[k][c] * by_parts[k][m] * slopes[m][e];
                    for (int k = 0; k < 4; ++k)
                        sum -= overlap[k] * part[paired[k]]
                            * (by[4 + k][c] * by[8 + k][e] + by[8 + k][c] * by[4 + k][e]);
                    second[c * $d + e] = sum;
                }}
            for (int c = 0; c < 2; ++c)
                for (int e = 0; e < 2; ++e)
                    second[($knee + c) * $d + $knee + e] += (c == e ? knee_bent : -knee_bent)
                        + bend[$d] * (c ? 1.0 - knee_left : knee_left) * (e ? 1.0 - knee_left : knee_left);
        }}
"""
CURVATURE: Final = """\
/* Second derivative of the smooth maximum by its first argument. */
static double ${name}_bend(double difference, double width)
{
    const double root = sqrt(difference * difference + width * width);
    return 0.5 * width * width / (root * root * root);
}

/* Mixed derivatives of the trilinear interpolation by scores 0 and 1, 0 and 2, 1 and 2. */
static void ${name}_mixed(const double *table, const int last[3], const double score[3], double mixed[3])
{
    double p[3], inside[3];
    int corner[3];
    for (int k = 0; k < 3; ++k) corner[k] = ${name}_cell_of(score[k], last[k], &p[k], &inside[k]);
    const int stride[3] = {(last[1] + 1) * (last[2] + 1), last[2] + 1, 1};
    const double *v = table + corner[0] * stride[0] + corner[1] * stride[1] + corner[2];
    for (int i = 0; i < 2; ++i)
        for (int j = i + 1; j < 3; ++j) {
            const int one = stride[i], other = stride[j], third = 3 - i - j;
            const double *w = v + stride[third];
            const double here = v[one + other] - v[one] - v[other] + v[0];
            const double beyond = w[one + other] - w[one] - w[other] + w[0];
            mixed[i + j - 1] = inside[i] * inside[j] * (here + p[third] * (beyond - here));
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

${curvature}static double ${name}_at(const double *angles, double load, const double *coupling, double activity,
                         double *gradient, double *second)
{
    static const int column[$rows] = $column;
    static const int group_of[$rows] = $group;
    static const double scale[$rows] = $scale;
    static const double offset[$rows] = $offset;
    static const double height[$rows] = $height;
    static const double overlap[4] = $overlap;
    static const int paired[4] = {0, 3, 7, 8}, single[5] = {6, 1, 2, 4, 5};
    static const int last[2][3] = {{4, 2, 3}, {5, 1, 2}};
    double step[$rows], group[17] = {0.0}, part[9], own[3][3], score[3], slope[3][3], knee_left,
        side_left;
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
        for (int k = 0; k < 3; ++k) own[t][k] = part[3 * k + t];
        score[t] = ${name}_trilinear(t ? ${name}_table_b : ${name}_table_a, last[t > 0], own[t], slope[t]);
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
    if (gradient || second) {
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
$second_derivatives    }
    return low + x * (high - low) + activity + check;
}
"""
