// SPDX-License-Identifier: BSL-1.0
#include "trainers.hpp"

#include <cles/printable.hpp>

#include "digits/model.hpp"
#include "dsgd/offers.hpp"

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/steady_timer.hpp>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <optional>
#include <stdexcept>

#include <unistd.h>

namespace dsgd {
namespace {

using steady = std::chrono::steady_clock;

constexpr std::chrono::milliseconds busy_pause{20};

} // namespace

struct trainers::course {
    round_plan& plan;
    digits::order what;
    const std::function<void(const round_result&)>& told;
    std::uint64_t first_seed;
    std::uint64_t bytes = 0;
    std::exception_ptr crash{};
    steady::time_point begun = steady::now();

    course(round_plan& all, const digits::order& how, const std::function<void(const round_result&)>& listener)
        : plan(all), what(how), told(listener), first_seed(how.seed.value_or(1)) {
        begin_round();
    }

    double ms() const { return std::chrono::duration<double, std::milli>(steady::now() - begun).count(); }

    void begin_round() {
        what.start = to_model(plan.present());
        what.seed = first_seed + plan.round() - 1;
    }

    // Its coroutines end with this. One that has crashed ends `run`.
    auto ending() {
        return [this](const std::exception_ptr& why) { crash = crash ? crash : why; };
    }
};

trainers::trainers(const std::vector<std::string>& seeds, const std::vector<std::string>& names,
                   std::chrono::seconds deadline)
    : deadline_(deadline),
      node_(io_,
            {.name = "dsgd-" + std::to_string(::getpid()), .gossip = cles::gossip(seeds), .routing = cles::routing()}),
      names_(names), newcomers_(names) {}

std::map<std::string, digits::offer> trainers::find(std::uint32_t pixels, std::uint32_t classes) {
    pixels_ = pixels;
    classes_ = classes;
    auto found = find_offers<digits::offer>(node_, "digits", "libcles-digits.so");
    for (const auto& name : names_) {
        if (!found.contains(name)) {
            throw cles::error(cles::errc::no_target, "'" + name + "' does not offer 'digits': see cles ls --tasks");
        }
    }
    std::erase_if(found, [&](const auto& each) {
        return !names_.empty() && std::find(names_.begin(), names_.end(), each.first) == names_.end();
    });
    for (const auto& [name, offer] : found) {
        if (offer.pixels != pixels || offer.classes != classes) {
            throw cles::error(cles::errc::bad_request, "'" + name + "' has images of another kind than the test: " +
                                                           std::to_string(offer.pixels) + " pixels, " +
                                                           std::to_string(offer.classes) + " classes");
        }
    }
    for (const auto& each : found) {
        newcomers_.joined(each.first, peer_of(node_, each.first).epoch);
    }
    return found;
}

std::uint64_t trainers::run(round_plan& plan, const digits::order& how,
                            const std::function<void(const round_result&)>& told) {
    for (const auto& member : newcomers_.members()) {
        plan.join(member.first);
    }
    course now{plan, how, told};
    ask(now);
    boost::asio::co_spawn(io_, watch(now), now.ending());
    io_.restart();
    while (!plan.finished() && !now.crash && io_.run_one() != 0) {
    }
    if (now.crash) {
        std::rethrow_exception(now.crash);
    }
    node_.stop(); // nodes that are late stop, too
    return now.bytes;
}

void trainers::ask(course& now) {
    for (const auto& node : now.plan.to_ask(now.ms())) {
        boost::asio::co_spawn(io_, train(now, node), now.ending());
    }
}

void trainers::advance(course& now) {
    const auto ended = now.plan.end_round(now.ms());
    if (ended) {
        now.begin_round();
    }
    ask(now);
    if (!ended) {
        return;
    }
    for (const auto& node : ended->late) {
        std::fprintf(stderr, "cles-dsgd: round %ju: %s is late; the round ends without it\n",
                     std::uintmax_t{ended->round}, cles::printable(node).c_str());
    }
    now.told(*ended);
}

boost::asio::awaitable<void> trainers::train(course& now, std::string node) {
    const auto round = now.plan.round();
    const auto options = cles::call_options{}.deadline(deadline_);
    const auto noun = node + ":digits/train";
    std::optional<cles::error> failure;
    try {
        now.bytes += now.what.start.weights.size();
        const auto part = co_await node_.async_delegate<digits::trained>(noun, now.what, options);
        now.bytes += part.result.weights.size();
        now.plan.answered(node, round, from_model(part.result), part.steps, part.loss, now.ms());
    } catch (const cles::error& e) {
        failure = e;
    } catch (const std::invalid_argument& e) {
        failure.emplace(cles::errc::conversion, std::string{"its network: "} + e.what());
    }
    if (failure) {
        now.plan.failed(node, round, *failure);
        const auto left = now.plan.members();
        const bool is_member = std::find(left.begin(), left.end(), node) != left.end();
        if (!is_member) {
            newcomers_.left(node);
        }
        if (!is_member && !now.plan.failure()) {
            std::fprintf(stderr, "cles-dsgd: round %ju: %s: %s; the others go on\n", std::uintmax_t{round},
                         cles::printable(node).c_str(), failure->what());
        }
        if (is_member) { // it is busy
            boost::asio::steady_timer pause{io_, busy_pause};
            co_await pause.async_wait(boost::asio::use_awaitable);
        }
    }
    advance(now);
}

boost::asio::awaitable<void> trainers::watch(course& now) {
    boost::asio::steady_timer timer{io_};
    for (int turn = 0; !now.plan.finished(); ++turn) {
        timer.expires_after(watch_interval);
        co_await timer.async_wait(boost::asio::use_awaitable);
        advance(now);
        if (turn % peers_every != 0) {
            continue;
        }
        for (const auto& each : newcomers_.among(node_.peers())) {
            boost::asio::co_spawn(io_, meet(now, each.node, each.epoch), now.ending());
        }
    }
}

boost::asio::awaitable<void> trainers::meet(course& now, std::string node, std::string epoch) {
    const auto options = cles::call_options{}.deadline(find_deadline);
    const auto noun = node + ":digits";
    try {
        const auto offer = co_await node_.async_pull<digits::offer>(noun, options);
        if (offer.pixels == pixels_ && offer.classes == classes_) {
            newcomers_.joined(node, epoch);
            now.plan.join(node);
            std::fprintf(stderr, "cles-dsgd: %s takes part from now on\n", cles::printable(node).c_str());
        }
    } catch (const cles::error&) { // it does not offer the task, or is gone
    }
}

} // namespace dsgd
