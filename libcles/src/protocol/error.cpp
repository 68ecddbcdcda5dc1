// SPDX-License-Identifier: BSL-1.0
#include <cles/error.hpp>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

namespace cles {
namespace {

namespace conditions = boost::system::errc;
using boost::system::error_condition;

struct entry {
    errc code;
    std::string_view name;
    const char* text;
    std::optional<conditions::errc_t> condition{}; // with the same meaning
};

// In the order of the protocol's table: the wire codes are the first ten.
constexpr std::array entries{
    entry{errc::bad_request, "bad_request", "the request is malformed", conditions::invalid_argument},
    entry{errc::denied, "denied", "the access rules forbid it", conditions::permission_denied},
    entry{errc::no_target, "no_target", "no route to the target is known", conditions::host_unreachable},
    entry{errc::no_task, "no_task", "the target does not offer that verb and task",
          conditions::operation_not_supported},
    entry{errc::too_large, "too_large", "the message or its answer exceeds a limit", conditions::message_size},
    entry{errc::cancelled, "cancelled", "the request was cancelled", conditions::operation_canceled},
    entry{errc::failed, "failed", "the handler failed"},
    entry{errc::unavailable, "unavailable", "the link or node was lost before the answer",
          conditions::connection_reset},
    entry{errc::busy, "busy", "refused before it started", conditions::resource_unavailable_try_again},
    entry{errc::deadline, "deadline", "the deadline passed", conditions::timed_out},
    entry{errc::would_deadlock, "would_deadlock", "a blocking request inside a handler would never end",
          conditions::resource_deadlock_would_occur},
    entry{errc::invalid_url, "invalid_url", "not a link address", conditions::invalid_argument},
    entry{errc::unknown_scheme, "unknown_scheme", "no transport has that URL scheme",
          conditions::protocol_not_supported},
    entry{errc::insecure_listen, "insecure_listen", "listening beyond this host without credentials needs 'insecure'",
          conditions::operation_not_permitted},
    entry{errc::invalid_name, "invalid_name", "not a valid name of a node or task", conditions::invalid_argument},
    entry{errc::already_registered, "already_registered", "the verb and task have a handler already",
          conditions::file_exists},
    entry{errc::conversion, "conversion", "the JSON does not match the type", conditions::bad_message},
    entry{errc::stopped, "stopped", "the service has been stopped", conditions::operation_canceled},
    entry{errc::invalid_option, "invalid_option", "an option is out of range", conditions::invalid_argument},
    entry{errc::closed, "closed", "the feed is not open", conditions::bad_file_descriptor},
};
constexpr std::size_t wire_codes = 10;

const entry* find(int value) noexcept {
    const auto* const found = std::ranges::find(entries, static_cast<errc>(value), &entry::code);
    return found == entries.end() ? nullptr : found;
}

class category final : public boost::system::error_category {
  public:
    // With an id, since a program and each of its shared libraries may have a category of their own.
    constexpr category() noexcept : error_category(0xC8B3'5A1E'94D2'706FU) {}

    const char* name() const noexcept override { return "cles"; }
    std::string message(int value) const override {
        const auto* e = find(value);
        return e != nullptr ? e->text : "unknown error";
    }
    error_condition default_error_condition(int value) const noexcept override {
        const auto* e = find(value);
        return e != nullptr && e->condition ? make_error_condition(*e->condition) : error_condition{value, *this};
    }
    bool equivalent(int value, const error_condition& condition) const noexcept override {
        const auto code = static_cast<errc>(value);
        return default_error_condition(value) == condition ||
               (code == errc::busy && condition == make_error_condition(conditions::device_or_resource_busy)) ||
               (code == errc::unavailable && condition == make_error_condition(conditions::connection_aborted));
    }
};

std::string describe(const boost::system::error_code& code, const std::string& message) {
    if (code.category() != error_category()) {
        return message.empty() ? code.message() : message;
    }
    const auto* e = find(code.value());
    std::string text{e != nullptr ? e->name : "failed"};
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
    const auto* const end = entries.begin() + wire_codes;
    const auto* const found = std::ranges::find(entries.begin(), end, name, &entry::name);
    return found == end ? errc::failed : found->code;
}

error::error(errc code, std::string message) : error(make_error_code(code), std::move(message)) {}

error::error(boost::system::error_code code, std::string message)
    : system_error(code), message_(std::move(message)), what_(describe(code, message_)) {}

} // namespace cles
