// SPDX-License-Identifier: BSL-1.0
#include "participant.hpp"

#include <cles/printable.hpp>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <stdexcept>
#include <utility>

namespace dsgd {
namespace {

constexpr std::chrono::milliseconds wait_interval{20};
constexpr std::chrono::milliseconds bind_pause{100};
constexpr std::chrono::seconds close_limit{2};

std::string in_words(const digits::shape& form) {
    return std::to_string(form.inputs) + " pixels, " + std::to_string(form.hidden) + " hidden values, " +
           std::to_string(form.classes) + " classes";
}

} // namespace

participant::participant(const options& wanted, const digits::image_set& images, digits::network start)
    : wanted_(wanted), images_(images), form_(start.form), now_(std::move(start)),
      all_(wanted.neighbours, wanted.patience_ms), node_(io_, {.name = wanted.name,
                                                               .listen = {wanted.listen},
                                                               .insecure = wanted.insecure,
                                                               .gossip = cles::gossip(wanted.seeds)}) {}

double participant::ms() const {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begun_).count();
}

std::uint64_t participant::run(const std::function<void(const round_result&, const digits::network&)>& told) {
    publish(0, now_);
    for (const auto& neighbour : wanted_.neighbours) {
        boost::asio::co_spawn(io_, follow(neighbour),
                              [this](const std::exception_ptr& why) { crash_ = crash_ ? crash_ : why; });
    }
    boost::asio::co_spawn(io_, train(told), [this](const std::exception_ptr& why) {
        crash_ = crash_ ? crash_ : why;
        ended_ = true;
    });
    while (!ended_ && !crash_ && io_.run_one() != 0) {
    }
    node_.stop();
    if (crash_) {
        std::rethrow_exception(crash_);
    }
    return bytes_;
}

void participant::publish(std::uint64_t round, const digits::network& n) {
    const told_network told{.round = round, .degree = all_.degree(), .network = to_model(n)};
    node_.update("model", told);
    bytes_ += told.network.weights.size() * all_.degree();
}

boost::asio::awaitable<void>
participant::train(const std::function<void(const round_result&, const digits::network&)>& told) {
    for (std::uint64_t round = 0; round < wanted_.rounds;) {
        // The last round is not left out: neighbours that are behind get its network.
        round = round == 0 ? 1 : std::min(all_.next_round(), wanted_.rounds);
        round_result ended{.round = round, .images = wanted_.how.passes * images_.size(), .began_ms = ms()};
        auto how = wanted_.how;
        how.seed += round - 1;
        digits::descent work{images_, std::move(now_), how};
        while (work.step()) { // meanwhile, the node answers, and hears its neighbours
            co_await boost::asio::post(io_, boost::asio::use_awaitable);
        }
        if (work.diverged()) {
            throw cles::error(cles::errc::failed, digits::diverged);
        }
        all_.trained(round, work.result(), ms());
        publish(round, work.result());
        while (!all_.ready(ms())) {
            heard_.expires_after(wait_interval);
            boost::system::error_code cancelled;
            co_await heard_.async_wait(boost::asio::redirect_error(boost::asio::use_awaitable, cancelled));
        }
        now_ = all_.mix(ms());
        ended.ended_ms = ms();
        ended.loss = work.mean_loss();
        ended.nodes = all_.mixed();
        ended.nodes.push_back(wanted_.name);
        ended.late.assign(all_.absent().begin(), all_.absent().end());
        told(ended, now_);
    }
    co_await node_.async_close(close_limit); // the last network reaches the neighbours
}

boost::asio::awaitable<void> participant::follow(std::string neighbour) {
    const auto noun = neighbour + ":model";
    const auto shown = cles::printable(neighbour);
    std::string wrong; // with what it has published last, so that it is said once
    for (boost::asio::steady_timer pause{io_}; !ended_;) {
        try {
            auto feed = co_await node_.async_bind<told_network>(noun);
            for (;;) {
                const auto event = co_await feed.async_next();
                if (event.has_value()) {
                    const auto& its = event.value;
                    bytes_ += its.network.weights.size();
                    auto network = from_model(its.network);
                    if (network.form != form_) {
                        throw std::invalid_argument("its shape is not that of this node's: " + in_words(network.form) +
                                                    ", and " + in_words(form_));
                    }
                    // One that goes on for longer than this node is at this node's last round.
                    all_.hear(neighbour, std::min(its.round, wanted_.rounds), its.degree, std::move(network));
                    heard_.cancel();
                    wrong.clear();
                } else if (event.kind == cles::feed_event::lost && all_.last_round(neighbour) < wanted_.rounds) {
                    all_.lose(neighbour);
                    heard_.cancel();
                    std::fprintf(stderr, "cles-dsgd: %s is lost: %s\n", shown.c_str(),
                                 cles::printable(event.text).c_str());
                }
            }
        } catch (const cles::error& e) { // it is not there yet, or has published something else
            if (e.code() == cles::errc::stopped) {
                co_return;
            }
        } catch (const std::invalid_argument& e) {
            if (wrong != e.what()) {
                wrong = e.what();
                std::fprintf(stderr, "cles-dsgd: %s: its network: %s\n", shown.c_str(), e.what());
            }
        }
        pause.expires_after(bind_pause);
        co_await pause.async_wait(boost::asio::use_awaitable);
    }
}

} // namespace dsgd
