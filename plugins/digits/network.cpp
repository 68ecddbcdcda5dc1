// SPDX-License-Identifier: BSL-1.0
#include "network.hpp"

#include "sgd/random_source.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace digits {

void check(const shape& form) {
    if (form.inputs == 0 || form.hidden == 0 || form.classes < 2) {
        throw std::invalid_argument("a network has inputs, hidden values and at least two classes");
    }
    // Each of them first, so that the product of two does not overflow.
    if (std::max({form.inputs, form.hidden, form.classes}) > most_weights || form.weights() > most_weights) {
        throw std::invalid_argument("a network has at most " + std::to_string(most_weights) + " weights");
    }
}

network made(const shape& form, std::uint64_t seed) {
    check(form);
    network out{.form = form, .weights = std::vector<float>(form.weights())};
    sgd::random_source chance{seed};
    const auto fill = [&](std::size_t from, std::size_t count, std::uint32_t inputs) {
        const auto most = std::sqrt(6.0 / inputs); // He and others, "Delving deep into rectifiers", 2015
        for (std::size_t i = from; i < from + count; ++i) {
            out.weights[i] = static_cast<float>(chance.within_one() * most);
        }
    };
    const auto first = std::size_t{form.inputs} * form.hidden;
    fill(0, first, form.inputs);
    fill(first + form.hidden, std::size_t{form.hidden} * form.classes, form.hidden);
    return out;
}

bool is_finite(const network& n) noexcept {
    return std::all_of(n.weights.begin(), n.weights.end(), [](float w) { return std::isfinite(w); });
}

// Sums go from input to input, so that the values of a layer are computed side by side without reordering a sum: the
// result does not depend on how many of them the processor computes at once.
void forward_pass::run(const network& n, std::span<const float> image) {
    const auto [inputs, hidden, classes] = n.form;
    const float* weights = n.weights.data();
    const float* biases = weights + std::size_t{inputs} * hidden;
    std::copy_n(biases, hidden, hidden_.data());
    for (std::uint32_t i = 0; i < inputs; ++i, weights += hidden) {
        const auto pixel = image[i];
        if (pixel == 0) { // as about half of them are
            continue;
        }
        for (std::uint32_t k = 0; k < hidden; ++k) {
            hidden_[k] += pixel * weights[k];
        }
    }
    for (auto& value : hidden_) {
        value = std::max(value, 0.0F);
    }
    weights = biases + hidden;
    std::copy_n(weights + std::size_t{hidden} * classes, classes, scores_.data());
    for (std::uint32_t k = 0; k < hidden; ++k, weights += classes) {
        const auto value = hidden_[k];
        for (std::uint32_t c = 0; c < classes; ++c) {
            scores_[c] += value * weights[c];
        }
    }
}

double accuracy(const network& n, const image_set& images) {
    forward_pass pass{n.form};
    std::size_t right = 0;
    for (std::size_t i = 0; i < images.size(); ++i) {
        pass.run(n, images.image(i));
        const auto scores = pass.scores();
        const auto best = std::max_element(scores.begin(), scores.end());
        right += static_cast<std::size_t>(best - scores.begin()) == images.class_of(i) ? 1U : 0U;
    }
    return static_cast<double>(right) / static_cast<double>(images.size());
}

network average(const std::vector<weighted_network>& parts) {
    double all = 0;
    for (const auto& part : parts) {
        all += part.weight;
    }
    const auto& form = parts.front().of->form;
    std::vector<double> sums(form.weights());
    for (const auto& part : parts) {
        const auto share = part.weight / all;
        for (std::size_t i = 0; i < sums.size(); ++i) {
            sums[i] += share * static_cast<double>(part.of->weights[i]);
        }
    }
    network out{.form = form, .weights = std::vector<float>(sums.size())};
    std::transform(sums.begin(), sums.end(), out.weights.begin(), [](double sum) { return static_cast<float>(sum); });
    return out;
}

} // namespace digits
