// SPDX-License-Identifier: BSL-1.0
#include "tasks.hpp"

#include <cles/setting_error.hpp>

#include "descent.hpp"
#include "order.hpp"
#include "sgd/take_steps.hpp"

#include <chrono>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>

#include <unistd.h>

namespace digits {
namespace {

using cles::errc;
using cles::error;
using steady = std::chrono::steady_clock;

constexpr std::uint64_t most_passes = 10'000;

[[noreturn]] void refuse(const std::string& why) { throw error(errc::bad_request, why); }

schedule checked(const order& what) {
    schedule how;
    how.passes = what.passes.value_or(how.passes);
    if (how.passes == 0 || how.passes > most_passes) {
        refuse("passes: 1 to " + std::to_string(most_passes));
    }
    how.rate = what.rate.value_or(how.rate);
    if (!std::isfinite(how.rate) || how.rate <= 0) {
        refuse("rate: more than 0");
    }
    how.seed = what.seed.value_or(how.seed);
    return how;
}

network checked(const model& start, const image_set& images) {
    const auto& kind = images.header();
    if (start.inputs != kind.pixels || start.classes != kind.classes) {
        refuse("this node's images have " + std::to_string(kind.pixels) + " pixels, and are of " +
               std::to_string(kind.classes) + " classes");
    }
    try {
        return from_model(start);
    } catch (const std::invalid_argument& e) {
        refuse(std::string{"start: "} + e.what());
    }
}

void train(const cles::request& asked, const cles::responder& answer, const image_set& images) {
    if (asked.parameters().size() != 1 || asked.parameters().front() != "train") {
        refuse("only digits/train can be delegated");
    }
    const auto begun = steady::now();
    const auto what = asked.as<order>();
    const auto how = checked(what);
    descent work{images, checked(what.start, images), how};
    if (!sgd::take_steps(work, answer)) {
        return;
    }
    if (work.diverged()) {
        throw error(errc::failed, diverged);
    }
    const std::chrono::duration<double, std::milli> took = steady::now() - begun;
    answer.done(trained{.node = std::string{asked.node()},
                        .result = to_model(work.result()),
                        .images = images.size(),
                        .steps = work.steps(),
                        .loss = work.mean_loss(),
                        .ms = took.count()});
}

} // namespace

void settings::check() const {
    if (files.empty()) {
        throw cles::setting_error("files", "files: at least one");
    }
    for (const auto& name : files) {
        if (::access(name.c_str(), R_OK) != 0) {
            throw cles::setting_error("files", name + ": it cannot be read");
        }
    }
}

void register_tasks(cles::registrar& to, const settings& wanted) {
    wanted.check();
    std::shared_ptr<const image_set> images;
    try {
        images = std::make_shared<const image_set>(image_set::read(wanted.files));
    } catch (const std::invalid_argument& e) {
        throw cles::setting_error("files", e.what());
    }
    const auto& kind = images->header();
    const offer told{.images = images->size(), .pixels = kind.pixels, .classes = kind.classes};
    to.on_pull(
        "digits", [told] { return told; },
        {.description = "How many images digits/train uses, and of which kind", .idempotent = true, .inline_ok = true});
    to.on_delegate(
        "digits",
        [images](const cles::request& asked, const cles::responder& answer) { train(asked, answer, *images); },
        {.description = "digits/train: a network, trained further on this node's images",
         .parameters = {"train"},
         .idempotent = true,
         .local = true}); // other nodes have other images
}

} // namespace digits
