// SPDX-License-Identifier: BSL-1.0
#include "classifier.hpp"

#include <cstddef>

namespace sgd {

double mean_squared_error(const data_set& data, const classifier& c) {
    double sum = 0;
    for (std::size_t i = 0; i < data.size(); ++i) {
        const auto off = c.value(data[i]) - data_set::label(i);
        sum += off * off;
    }
    return sum / static_cast<double>(data.size());
}

// Centred, so that two equations are left, which Cramer's rule solves.
classifier least_squares(const data_set& data) {
    const auto count = static_cast<double>(data.size());
    double x = 0;
    double y = 0;
    double label = 0;
    for (std::size_t i = 0; i < data.size(); ++i) {
        x += data[i].x / count;
        y += data[i].y / count;
        label += data_set::label(i) / count;
    }
    double xx = 0;
    double xy = 0;
    double yy = 0;
    double xl = 0;
    double yl = 0;
    for (std::size_t i = 0; i < data.size(); ++i) {
        const auto dx = data[i].x - x;
        const auto dy = data[i].y - y;
        const auto dl = data_set::label(i) - label;
        xx += dx * dx;
        xy += dx * dy;
        yy += dy * dy;
        xl += dx * dl;
        yl += dy * dl;
    }
    const auto determinant = xx * yy - xy * xy;
    classifier best{.weights = {(xl * yy - yl * xy) / determinant, (yl * xx - xl * xy) / determinant}};
    best.bias = label - best.weights[0] * x - best.weights[1] * y;
    return best;
}

quality judge(const data_set& data, const classifier& c) {
    std::size_t wrong = 0;
    for (std::size_t i = 0; i < data.size(); ++i) {
        wrong += (c.value(data[i]) > 0.5) != (data_set::label(i) > 0.5) ? 1 : 0;
    }
    return {.mse = mean_squared_error(data, c),
            .least_mse = mean_squared_error(data, least_squares(data)),
            .wrong = static_cast<double>(wrong) / static_cast<double>(data.size())};
}

} // namespace sgd
