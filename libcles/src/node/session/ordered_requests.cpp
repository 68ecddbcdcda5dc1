// SPDX-License-Identifier: BSL-1.0
#include "node/session/ordered_requests.hpp"

#include "node/base/scoped_flag.hpp"
#include "protocol/reply_line.hpp"

namespace cles::core {
namespace {

// Limits of one pass over the waiting requests, so that other links are served in between.
constexpr int requests_per_turn = 256;
constexpr std::size_t bytes_per_turn = 65536;

} // namespace

bool ordered_requests::push(std::string_view line, time_point arrived, bool always) {
    const auto bytes = held_.size() + line.size();
    if (always) {
        held_.resize(bytes);
    } else if (!held_.try_resize(bytes)) {
        return false;
    }
    waiting_.push_back({.line = std::string{line}, .reply = {}, .arrived = arrived});
    update_pause();
    return true;
}

void ordered_requests::push_reply(std::string reply) {
    held_.resize(held_.size() + reply.size());
    if (!waiting_.empty() && waiting_.back().line.empty() && waiting_.back().reply == reply) {
        ++waiting_.back().times;
    } else {
        waiting_.push_back({.line = {}, .reply = std::move(reply)});
    }
    update_pause();
}

// Pauses reading while the waiting requests take too much memory.
void ordered_requests::update_pause() {
    const auto most = node_.bounds.waiting;
    const bool too_much = held_.size() > (paused_ ? most / 2 : most);
    if (too_much != paused_) {
        paused_ = too_much;
        out_.pause(too_much);
    }
}

void ordered_requests::serve(const serve_function& run) {
    const scoped_flag serving{serving_};
    const auto before = out_.output().size();
    int turn = requests_per_turn;
    while (has_more()) {
        if (turn-- == 0 || out_.output().size() > before + bytes_per_turn) {
            out_.wake(); // continues after the pending output has been sent
            break;
        }
        const auto next = std::move(waiting_.front());
        waiting_.pop_front();
        held_.resize(held_.size() - next.line.size() - next.reply.size() * next.times);
        if (!next.line.empty()) {
            protocol::request_line r;
            protocol::malformed_request ignored;
            protocol::parse_request(next.line, r, ignored); // was valid on arrival
            run(r, next.arrived);
        }
        for (std::size_t i = 0; i < next.times && !next.reply.empty(); ++i) {
            out_.output().append(next.reply).push_back('\n');
            node_.counts.errors += protocol::is_failure(next.reply) ? 1 : 0;
        }
    }
    update_pause();
}

std::shared_ptr<call> ordered_requests::clear() noexcept {
    waiting_.clear();
    held_.resize(0);
    return std::exchange(running_, nullptr);
}

} // namespace cles::core
