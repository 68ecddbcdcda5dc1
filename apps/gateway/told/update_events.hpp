// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/convert.hpp>
#include <cles/feed.hpp>
#include <cles/update_mark.hpp>

#include <optional>
#include <string>
#include <string_view>

namespace gateway {

/// Appends a server-sent event. \param type empty: "message" \param id empty: none \param data JSON, on one line
void append_event(std::string& out, std::string_view type, std::string_view id, std::string_view data);

/// "5f3a09c1.17": an update, as the id of its event.
std::string event_id_of(const cles::update_mark& mark);
/// The update in `Last-Event-ID`; nothing if the text is no such id.
std::optional<cles::update_mark> mark_in(std::string_view event_id) noexcept;

/// Makes server-sent events of the events of a feed, for one client. A client that comes back with the id of the last
/// event that it has received gets no value twice, and is told how many it has missed.
///
/// | event | data |
/// | --- | --- |
/// | `message` | the value; of `all`, {"node":"car1","update":VALUE} |
/// | `gap` | {"missed":3}: so many updates were not received |
/// | `restart` | {"epoch":"5f3a09c1"}: the publisher is another one than before, and counts anew |
/// | `lost` | {"reason":TEXT}: the publisher is gone, or not there yet, or the right to bind has ended |
/// | `rebound` | {}: it is back |
/// | `failure` | of `all`: {"node":"car1","failure":FAILURE}, of a node that could not be bound |
class update_events {
  public:
    /// \param is_of_all the noun is one of `all` \param is_thinned it is bound with `every`, so that missing numbers
    /// are no gap \param last what the client has received
    update_events(bool is_of_all, bool is_thinned, std::optional<cles::update_mark> last)
        : is_of_all_(is_of_all), is_thinned_(is_thinned), last_(last) {}

    /// Appends what the client gets for this event.
    void take(const cles::feed_item<cles::json_text>& item, std::string& out);

  private:
    void take_value(const cles::feed_item<cles::json_text>& item, std::string& out);

    bool is_of_all_;
    bool is_thinned_;
    std::optional<cles::update_mark> last_;
    bool is_first_ = true;
};

} // namespace gateway
