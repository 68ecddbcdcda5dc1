// SPDX-License-Identifier: BSL-1.0
#include "tasks.hpp"

#include <cles/setting_error.hpp>

#include "order.hpp"
#include "take_steps.hpp"
#include "training.hpp"

#include <chrono>
#include <cmath>
#include <memory>
#include <string>

namespace sgd {
namespace {

using cles::errc;
using cles::error;
using steady = std::chrono::steady_clock;

constexpr std::uint64_t most_epochs = 1'000'000;

[[noreturn]] void refuse(const std::string& why) { throw error(errc::bad_request, why); }

schedule checked(const order& what, const data_set& data) {
    if (what.data && *what.data != data.made_from()) {
        refuse("this node has other data: " + to_string(data.made_from()));
    }
    if (what.count == 0 || what.first >= data.size() || what.count > data.size() - what.first) {
        refuse(std::to_string(what.count) + " points from point " + std::to_string(what.first) + ": there are " +
               std::to_string(data.size()));
    }
    schedule how;
    const auto epochs = what.epochs.value_or(1);
    if (epochs == 0 || epochs > most_epochs) {
        refuse("epochs: 1 to " + std::to_string(most_epochs));
    }
    how.rate = what.rate.value_or(how.rate);
    if (!std::isfinite(how.rate) || how.rate <= 0) {
        refuse("rate: more than 0");
    }
    how.steps = epochs * what.count;
    how.seed = what.seed.value_or(how.seed);
    return how;
}

void train(const cles::request& asked, const cles::responder& answer, const data_set& data) {
    if (asked.parameters().size() != 1 || asked.parameters().front() != "train") {
        refuse("only sgd/train can be delegated");
    }
    const auto begun = steady::now();
    const auto what = asked.as<order>();
    const auto how = checked(what, data);
    training work{data, {.first = what.first, .count = what.count}, how, what.start.value_or(classifier{})};
    if (!take_steps(work, answer)) {
        return;
    }
    if (!is_finite(work.result())) {
        throw error(errc::failed, diverged);
    }
    const std::chrono::duration<double, std::milli> took = steady::now() - begun;
    answer.done(trained{.node = std::string{asked.node()},
                        .result = work.result(),
                        .points = what.count,
                        .steps = how.steps,
                        .ms = took.count()});
}

} // namespace

void settings::check() const {
    if (const auto n = per_class.value_or(recipe{}.per_class); n == 0 || n > most_per_class) {
        throw cles::setting_error("per_class", "per_class: 1 to " + std::to_string(most_per_class));
    }
    if (!std::isfinite(separation.value_or(recipe{}.separation))) {
        throw cles::setting_error("separation", "separation: a number");
    }
}

void register_tasks(cles::registrar& to, const settings& wanted) {
    wanted.check();
    recipe from;
    from.seed = wanted.seed.value_or(from.seed);
    from.per_class = wanted.per_class.value_or(from.per_class);
    from.separation = wanted.separation.value_or(from.separation);
    const auto data = std::make_shared<const data_set>(from);
    to.on_pull("sgd", [data] { return data->made_from(); },
               {.description = "The parameters of the data for sgd/train", .idempotent = true, .inline_ok = true});
    to.on_delegate("sgd",
                   [data](const cles::request& asked, const cles::responder& answer) { train(asked, answer, *data); },
                   {.description = "sgd/train: a linear classifier for 'count' points from point 'first'",
                    .parameters = {"train"},
                    .idempotent = true,
                    .local = true}); // other nodes may have other data
}

} // namespace sgd
