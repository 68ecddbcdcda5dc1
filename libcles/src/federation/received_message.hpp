// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/limits.hpp>

#include "federation/subject.hpp"

#include <string_view>

namespace cles::bridging {

/// The bridge that has sealed a message; empty in a fleet without security.
struct message_sender {
    std::string_view member{};
    std::string_view instance{};
};

/// A message of NATS. Its subjects are parsed once, for all that read them.
struct received_message {
    received_message(std::string_view subject, std::string_view reply_to, std::string_view message, time_point now,
                     message_sender sender = {})
        : where(subject), reply(reply_to), text(message), at(now), by(sender), about(parse_subject(subject)),
          from(parse_subject(reply_to)) {}

    std::string_view where;
    std::string_view reply; ///< the subject for replies; empty: there is none
    std::string_view text;
    time_point at; ///< when it was received
    message_sender by;
    subject about; ///< `where`
    subject from;  ///< `reply`
};

} // namespace cles::bridging
