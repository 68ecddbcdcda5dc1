// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include <array>
#include <utility>

namespace cles {
namespace {

struct entry {
    errc code;
    std::string_view name;
    const char* text;
};

// The order is that of the protocol's table, so that the wire codes are the first ten.
constexpr std::array entries{
    entry{errc::bad_request, "bad_request", "the request is malformed"},
    entry{errc::denied, "denied", "the access rules forbid it"},
    entry{errc::no_target, "no_target", "no way to the target is known"},
    entry{errc::no_task, "no_task", "the target does not offer that verb and task"},
    entry{errc::too_large, "too_large", "the message or its answer exceeds a limit"},
    entry{errc::cancelled, "cancelled", "the request was withdrawn"},
    entry{errc::failed, "failed", "the handler failed"},
    entry{errc::unavailable, "unavailable", "the link or node was lost before the answer"},
    entry{errc::busy, "busy", "refused before it started"},
    entry{errc::deadline, "deadline", "the time ran out"},
    entry{errc::would_deadlock, "would_deadlock", "a blocking request inside a handler would never end"},
    entry{errc::invalid_url, "invalid_url", "not a link address"},
    entry{errc::unknown_scheme, "unknown_scheme", "no transport has that URL scheme"},
    entry{errc::insecure_listen, "insecure_listen", "listening beyond this host without credentials needs 'insecure'"},
    entry{errc::invalid_name, "invalid_name", "not a name that a node or task may bear"},
    entry{errc::already_registered, "already_registered", "the verb and task have a handler already"},
    entry{errc::conversion, "conversion", "the JSON does not have the shape of the type"},
    entry{errc::stopped, "stopped", "the service has been stopped"},
    entry{errc::closed, "closed", "the feed is not open"},
};
constexpr std::size_t wire_codes = 10;

const entry* find(int value) noexcept {
    for (const auto& e : entries) {
        if (static_cast<int>(e.code) == value) {
            return &e;
        }
    }
    return nullptr;
}

class category final : public boost::system::error_category {
  public:
    const char* name() const noexcept override { return "cles"; }
    std::string message(int value) const override {
        const auto* e = find(value);
        return e != nullptr ? e->text : "unknown error";
    }
};

std::string describe(const boost::system::error_code& code, const std::string& message) {
    std::string text;
    if (code.category() == error_category()) {
        const auto* e = find(code.value());
        text = e != nullptr ? e->name : std::string_view{"failed"};
    } else {
        return message.empty() ? code.message() : message;
    }
    if (!message.empty()) {
        text.append(": ").append(message);
    }
    return text;
}

} // namespace

const boost::system::error_category& error_category() noexcept {
    static const category instance;
    return instance;
}

std::string_view wire_name(errc e) noexcept {
    const auto value = static_cast<int>(e);
    return value >= 1 && value <= static_cast<int>(wire_codes) ? find(value)->name : "failed";
}

errc errc_from_wire(std::string_view name) noexcept {
    for (std::size_t i = 0; i < wire_codes; ++i) {
        if (entries[i].name == name) {
            return entries[i].code;
        }
    }
    return errc::failed;
}

error::error(errc code, std::string message) : error(make_error_code(code), std::move(message)) {}

error::error(boost::system::error_code code, std::string message)
    : system_error(code), message_(std::move(message)), what_(describe(code, message_)) {}

} // namespace cles
