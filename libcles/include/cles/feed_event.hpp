// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/pending.hpp>
#include <cles/shared_reading.hpp>

#include <boost/system/error_code.hpp>

#include <cstdint>
#include <string_view>

namespace cles {

/// What happens to a binding, as its feed tells it.
enum class feed_event : std::uint8_t {
    current, ///< the publisher's last value, as it stood when the binding was made; it bears no `seq`
    update,  ///< an update
    gap,     ///< `missed` updates went by unseen
    lost,    ///< the publisher was lost, for the reason in `text`; the feed binds again by itself
    rebound, ///< the publisher is back
};

namespace detail {

/// An event as it comes from the link; views are valid for the call.
struct raw_event {
    feed_event kind = feed_event::update;
    std::string_view body = "{}";
    bool checked = false; ///< that the body is valid JSON
    std::string_view publisher{};
    std::uint64_t seq = 0;
    std::uint64_t missed = 0;
    std::string_view text{};
    std::string_view line{};           ///< of an update that is not queued: all of it
    shared_reading* reading = nullptr; ///< of the body, where other feeds are handed it too

    /// Whether the body is valid JSON; looked at only where that is not known.
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

/// One call of `async_next` that waits.
class pending_event {
  public:
    pending_event() = default;
    pending_event(const pending_event&) = delete;
    pending_event& operator=(const pending_event&) = delete;
    /// False where the event's body is not JSON: the operation goes on waiting. Else it has ended.
    virtual bool deliver(const raw_event& event) = 0;
    virtual void fail(boost::system::error_code code, std::string_view message) = 0;
    /// Destroys it without calling its handler.
    virtual void discard() noexcept = 0;
    /// As `pending::calls_user`.
    [[nodiscard]] virtual bool calls_user() const noexcept { return true; }

  protected:
    ~pending_event() = default;
};

} // namespace detail

} // namespace cles
