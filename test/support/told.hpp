// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/feed_event.hpp>
#include <cles/limits.hpp>
#include <cles/pending.hpp>

#include "node/publish/subscription.hpp"

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <utility>

namespace cles::test {

/// Records, as text, what a node reports to its own program.
using observed_source = std::function<void(std::string)>;

/// A request of the node itself whose outcome is reported: "7 ok {...}", "7 failed busy".
class told_reply final : public detail::pending {
  public:
    enum class state : std::uint8_t { waiting, ended };

    told_reply(std::uint64_t id, state& at, observed_source tell) : id_(id), at_(at), tell_(std::move(tell)) {
        at_ = state::waiting;
    }

    verdict offer(std::string_view json) override {
        if (!is_valid_json(json)) {
            return verdict::malformed;
        }
        end(" ok " + std::string{json});
        return verdict::completed;
    }
    void fail(boost::system::error_code code, std::string_view) override {
        end(" failed " + std::string{wire_name(static_cast<errc>(code.value()))});
    }
    void discard() noexcept override { delete this; }

  private:
    void end(const std::string& how) {
        at_ = state::ended;
        tell_(std::to_string(id_) + how);
        delete this;
    }

    std::uint64_t id_;
    state& at_;
    observed_source tell_;
};

/// A feed of the node itself whose events are reported: "update car2:fix 17 {...}", "gap car2:fix 3".
class told_feed final : public core::subscription {
  public:
    told_feed(std::string target, std::string path, bool thinned, observed_source tell)
        : subscription(std::move(target), std::move(path), thinned, limits{}.publishers), tell_(std::move(tell)) {}

  private:
    bool on_event(const detail::raw_event& event, core::feed_mailbox::hand_over) override {
        if (!event.has_json()) {
            return false;
        }
        const auto noun = std::string{event.publisher} + ":" + path();
        if (event.kind == feed_event::gap) {
            tell_("gap " + noun + " " + std::to_string(event.missed));
        } else {
            tell_("update " + noun + " " + std::to_string(event.seq) + " " + std::string{event.body});
        }
        return true;
    }

    observed_source tell_;
};

/// A feed of the node itself that keeps the numbers of what it receives: "1 2 gap 5 ".
class numbers_feed final : public core::subscription {
  public:
    using subscription::subscription;
    std::string heard;

  private:
    bool on_event(const detail::raw_event& event, core::feed_mailbox::hand_over) override {
        heard += event.kind == feed_event::gap ? "gap " : std::to_string(event.seq) + " ";
        return true;
    }
};

} // namespace cles::test
