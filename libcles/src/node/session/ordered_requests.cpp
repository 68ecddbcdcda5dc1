// SPDX-License-Identifier: BSL-1.0
#include "node/session/ordered_requests.hpp"

#include "node/base/scoped_flag.hpp"
#include "protocol/reply_line.hpp"

#include <utility>

namespace cles::core {
namespace {

// Limits of one pass over the waiting requests, so that other links are served in between.
constexpr int requests_per_turn = 256;
constexpr std::size_t bytes_per_turn = 65536;

} // namespace

bool ordered_requests::push(std::string_view line, time_point now, bool always) {
    if (!waiting_.push_line(line, now, always)) {
        return false;
    }
    update_pause();
    return true;
}

void ordered_requests::push_reply(std::string reply, time_point now) {
    waiting_.push_reply(std::move(reply), now);
    update_pause();
}

// Pauses reading while the waiting requests take too much memory.
void ordered_requests::update_pause() {
    const auto most = node_.bounds.waiting;
    const bool too_much = waiting_.bytes() > (paused_ ? most / 2 : most);
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
        const auto next = waiting_.pop();
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
    return std::exchange(running_, nullptr);
}

} // namespace cles::core
