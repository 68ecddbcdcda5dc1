// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>
#include <cles/shared_reading.hpp>

#include <boost/system/error_code.hpp>

#include <cstdint>
#include <string_view>

namespace cles {

/// The kinds of events of a feed.
enum class feed_event : std::uint8_t {
    current, ///< the publisher's last value when the binding was made; has a `seq` only with `bind_options::mark`
    update,  ///< an update
    gap,     ///< `missed` updates were not received
    lost,    ///< the publisher was lost, for the reason in `text`; the feed binds again by itself
    rebound, ///< the publisher is back
};

namespace detail {

/// An event as received from the link; views are valid during the call.
struct raw_event {
    feed_event kind = feed_event::update;
    std::string_view body = "{}";
    bool checked = false; ///< whether the body is known to be valid JSON
    std::string_view publisher{};
    std::uint64_t seq = 0;
    std::uint32_t epoch = 0;
    std::uint64_t missed = 0;
    std::string_view text{};
    std::string_view line{};           ///< of an update that is not queued: the whole line
    shared_reading* reading = nullptr; ///< of the body, if other feeds receive it too

    /// Whether the body is valid JSON; checks it only if that is not known yet.
    [[nodiscard]] bool has_json() const {
        if (checked || (reading != nullptr && reading->is_json())) {
            return true;
        }
        const bool found = is_valid_answer(body);
        if (found && reading != nullptr) {
            reading->found_json();
        }
        return found;
    }
};

class pending_batch;

/// A pending `async_next`.
class pending_event {
  public:
    pending_event() = default;
    pending_event(const pending_event&) = delete;
    pending_event& operator=(const pending_event&) = delete;
    /// Completes the operation. False if the event's body is not JSON: the operation stays pending.
    virtual bool deliver(const raw_event& event) = 0;
    virtual void fail(boost::system::error_code code, std::string_view message) = 0;
    /// Destroys it without calling its handler.
    virtual void discard() noexcept = 0;
    /// As `pending::calls_user`.
    [[nodiscard]] virtual bool calls_user() const noexcept { return true; }
    /// This, if it takes several events.
    [[nodiscard]] virtual pending_batch* as_batch() noexcept { return nullptr; }

  protected:
    ~pending_event() = default;
};

/// A pending `async_next_batch`: takes events until its owner completes it.
class pending_batch : public pending_event {
  public:
    enum class verdict : std::uint8_t {
        kept,
        malformed, ///< not kept: its body is not JSON
        full,      ///< not kept: those that it has must be delivered first
    };
    /// Reads an event and keeps it, or the reason why it cannot be read. Calls conversions, but no handler; what they
    /// throw changes nothing.
    [[nodiscard]] virtual verdict keep(const raw_event& event) = 0;
    /// Completes the operation. \pre it has kept something
    virtual void complete() = 0;

    bool deliver(const raw_event& event) final {
        const bool is_kept = keep(event) == verdict::kept;
        if (is_kept) {
            complete();
        }
        return is_kept;
    }
    [[nodiscard]] pending_batch* as_batch() noexcept final { return this; }

  protected:
    ~pending_batch() = default;
};

} // namespace detail

} // namespace cles
