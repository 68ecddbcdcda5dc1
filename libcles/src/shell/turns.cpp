// SPDX-License-Identifier: BSL-1.0
#include "shell/turns.hpp"

#include "shell/engine.hpp"

#include <boost/asio/post.hpp>

namespace cles::shell {
namespace {

// Publishers that go on in one turn, before others have theirs.
constexpr int most_go_on = 8;

} // namespace

void turns::ask() {
    if (!asked_ && !host_.stopped()) {
        asked_ = true;
        boost::asio::post(host_.executor(), [host = host_.shared_from_this()] { host->turns().turn(); });
    }
}

void turns::flush_soon(connection& c) {
    // Once stopped there are no more turns; `stop` itself flushes whatever is said on the way, like a farewell.
    if (!c.flush_asked_ && !host_.stopped()) {
        c.flush_asked_ = true;
        to_flush_.push_back(c.shared_from_this());
        ask();
    }
}

void turns::stop() {
    for (const auto& c : std::exchange(to_flush_, {})) {
        c->flush();
    }
}

void turns::turn() {
    asked_ = false;
    if (host_.stopped()) {
        return;
    }
    let_publishers_go_on();
    if (host_.stopped()) {
        return;
    }
    if (auto* routing = host_.routing()) {
        routing->drain(host_.now());
    }
    const auto gone = publish(false);
    flushing_.swap(to_flush_);
    for (const auto& c : flushing_) {
        c->flush_asked_ = false;
        c->flush();
    }
    flushing_.clear();
    if (gone) {
        gathering_.gone(*gone, host_.now()); // not before: to write to many binders takes longer than updates may wait
    }
    ask_if_something_waits();
    host_.settle();
}

// Each may publish again at once, and then waits here anew. The next turn is asked for first: what they do may throw.
void turns::let_publishers_go_on() {
    auto& published = host_.node().published;
    if (!published.has_results()) {
        return;
    }
    ask();
    for (int i = 0; i < most_go_on; ++i) {
        auto next = published.next_result();
        if (!next) {
            return;
        }
        next->tell();
    }
}

std::optional<std::uint64_t> turns::publish(bool alone) {
    auto& published = host_.node().published;
    if (!published.dirty()) {
        return std::nullopt;
    }
    const auto now = host_.now();
    if (alone ? !gathering_.alone(now) : gathering_.waits(published.published(), now)) {
        return std::nullopt;
    }
    const held during{*this}; // it is flushed right behind
    published.drain(now);
    return published.published();
}

void turns::say_at_once() {
    if (host_.stopped()) {
        return;
    }
    const auto gone = publish(true);
    std::erase_if(to_flush_, [&](const auto& c) {
        if (!(gone || c->asks_alone()) || !c->write()) {
            return false;
        }
        c->flush_asked_ = false;
        return true;
    });
    if (gone) {
        gathering_.gone(*gone, host_.now());
    }
    ask_if_something_waits();
}

void turns::ask_if_something_waits() {
    const auto& published = host_.node().published;
    if (published.dirty() || published.has_results() || !to_flush_.empty()) {
        ask();
    }
}

} // namespace cles::shell
