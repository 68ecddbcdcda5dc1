// SPDX-License-Identifier: BSL-1.0
#include "security/fleet/roster.hpp"

#include <cles/json_reader.hpp>

#include "json/json_members.hpp"
#include "protocol/grammar.hpp"
#include "security/fleet/group_keys.hpp"

#include <algorithm>
#include <functional>
#include <numeric>
#include <set>

namespace cles::security {
namespace {

// A line is these three parts, signature and content between them.
constexpr std::string_view line_start = R"({"signature":")";
constexpr std::string_view line_middle = R"(","roster":)";
constexpr std::string_view line_end = "}";
constexpr std::size_t signature_text_size = 86;
constexpr std::size_t content_at = line_start.size() + signature_text_size + line_middle.size();

std::string signed_text_of(std::string_view content) { return std::string{"cles roster 1\n"}.append(content); }

// The content of an unverified line; sets the signature.
std::string_view open_line(std::string_view line, signature& made) {
    if (line.size() > max_roster_line) {
        throw security_error{"a roster has at most 1,000,000 bytes"};
    }
    const auto content = line.size() > content_at ? line.substr(content_at, line.size() - content_at - 1) : "";
    if (!line.starts_with(line_start) || !content.starts_with('{') || !content.ends_with('}') ||
        line.substr(content_at - line_middle.size(), line_middle.size()) != line_middle || !line.ends_with(line_end) ||
        line.find('\n') != std::string_view::npos ||
        !read_base64url(line.substr(line_start.size(), signature_text_size), made)) {
        throw security_error{R"(a roster is a line of the form {"signature":"<86 characters>","roster":{...}})"};
    }
    return content;
}

// Skips a value. Fails if an object in it, at any depth, has a key twice. The reader limits the depth.
bool skip_without_repeats(json_reader& in) {
    switch (in.peek()) {
    case json_reader::kind::object: {
        std::set<std::string, std::less<>> keys;
        in.begin_object();
        for (std::string_view key; in.next_key(key);) {
            if (!keys.emplace(key).second) {
                return in.fail("the key " + protocol::quoted(key) + " occurs twice");
            }
            skip_without_repeats(in);
        }
        return in.ok();
    }
    case json_reader::kind::array:
        in.begin_array();
        while (in.next_element()) {
            skip_without_repeats(in);
        }
        return in.ok();
    default: return in.skip();
    }
}

bool read_whole(json_reader& in, std::uint32_t low, std::uint32_t high, std::uint32_t& out) {
    std::uint64_t value = 0;
    if (!in.read(value)) {
        return false;
    }
    if (value < low || value > high) {
        return in.fail("expected a whole number from " + std::to_string(low) + " to " + std::to_string(high));
    }
    out = static_cast<std::uint32_t>(value);
    return true;
}

bool read_key(json_reader& in, public_key& out) {
    std::string_view text;
    return in.read(text) && (read_base64url(text, out) || in.fail("expected 32 bytes as base64url"));
}

bool read_sealed(json_reader& in, std::string& out) {
    std::string_view text;
    if (!in.read(text)) {
        return false;
    }
    if (!is_sealed_group_keys(text)) {
        return in.fail("expected sealed group keys: 112 bytes as base64url");
    }
    out = text;
    return true;
}

bool read_texts(json_reader& in, std::vector<std::string>& out) {
    return core::read_texts(in, [&out](std::string_view text) { out.emplace_back(text); });
}

} // namespace

/// Reads the content of a line whose signature has been verified.
class roster_reader {
  public:
    roster_reader(roster& into, const roster* known) : roster_(into), known_(known) {}

    void read(std::string_view content) {
        // First of all, so that what follows need not expect a key twice.
        json_reader whole{content};
        if (!skip_without_repeats(whole) || !whole.at_end()) {
            throw security_error{"the roster is malformed: " + whole.error()};
        }
        json_reader in{content};
        if (!read_roster(in) || !check_members(in)) {
            throw security_error{"the roster is malformed: " + in.error()};
        }
    }

  private:
    bool read_roster(json_reader& in) {
        bool has_last = false;
        bool has_members = false;
        bool has_fleet = false;
        in.begin_object();
        for (std::string_view name; in.next_key(name);) {
            const std::string key{name};
            if (key == "fleet") {
                has_fleet = read_key(in, roster_.fleet_);
            } else if (key == "version") {
                read_whole(in, 1, max_version, roster_.version_);
            } else if (key == "last") {
                has_last = read_whole(in, 0, max_member_number, roster_.last_);
            } else if (key == "generation") {
                read_whole(in, 1, max_generation, roster_.generation_);
            } else if (key == "oldest") {
                read_whole(in, 1, max_generation, roster_.oldest_);
            } else if (key == "keys") {
                read_sealed(in, roster_.authority_keys_);
            } else if (key == "members") {
                has_members = read_members(in);
            } else {
                ignore(in, key);
            }
            if (!in.ok()) {
                in.inside_member(key);
            }
        }
        const auto missing = !has_fleet                        ? "fleet"
                             : roster_.version_ == 0           ? "version"
                             : !has_last                       ? "last"
                             : roster_.generation_ == 0        ? "generation"
                             : roster_.oldest_ == 0            ? "oldest"
                             : roster_.authority_keys_.empty() ? "keys"
                             : !has_members                    ? "members"
                                                               : nullptr;
        if (in.ok() && missing != nullptr) {
            in.fail(std::string{"the key '"} + missing + "' is missing");
        }
        if (in.ok() && roster_.oldest_ != roster_.generation_ && roster_.oldest_ + 1 != roster_.generation_) {
            in.fail("'oldest' is neither the generation nor the one before");
        }
        return in.ok();
    }

    bool read_members(json_reader& in) {
        in.begin_array();
        while (in.next_element()) {
            if (roster_.members_.size() == max_members) {
                return in.fail("more than 4096 members");
            }
            if (!read_member(in, roster_.members_.emplace_back())) {
                in.inside_element(roster_.members_.size() - 1);
            }
        }
        return in.ok();
    }

    bool read_member(json_reader& in, member& entry) {
        bool has_key = false;
        in.begin_object();
        for (std::string_view name; in.next_key(name);) {
            const std::string key{name};
            if (key == "number") {
                read_whole(in, 1, max_member_number, entry.number);
            } else if (key == "name") {
                read_name(in, entry.name);
            } else if (key == "key") {
                has_key = read_member_key(in, entry);
            } else if (key == "keys") {
                read_sealed(in, entry.group_keys);
            } else if (key == "may") {
                read_texts(in, entry.may.emplace());
            } else if (key == "offers") {
                read_texts(in, entry.offers.emplace());
            } else if (key == "forwards") {
                read_texts(in, entry.forwards);
            } else {
                ignore(in, key);
            }
            if (!in.ok()) {
                in.inside_member(key);
            }
        }
        const auto missing = entry.number == 0          ? "number"
                             : entry.name.empty()       ? "name"
                             : !has_key                 ? "key"
                             : entry.group_keys.empty() ? "keys"
                                                        : nullptr;
        return in.ok() && (missing == nullptr || in.fail(std::string{"the key '"} + missing + "' is missing"));
    }

    static bool read_name(json_reader& in, std::string& out) {
        if (!in.read(out)) {
            return false;
        }
        if (!protocol::is_name(out)) {
            return in.fail(protocol::quoted(out) + " is not a name");
        }
        return !protocol::is_reserved_target(out) || in.fail(protocol::quoted(out) + " is a reserved name");
    }

    bool read_member_key(json_reader& in, member& entry) const {
        if (!read_key(in, entry.key)) {
            return false;
        }
        const auto* const checked = known_ != nullptr ? known_->find(entry.key) : nullptr;
        const auto form = checked != nullptr ? checked->agreement : agreement_form(entry.key);
        if (!form) {
            return in.fail("not a key: expected a point of prime order, in its only encoding");
        }
        entry.agreement = *form;
        return true;
    }

    void ignore(json_reader& in, const std::string& key) {
        if (key.starts_with("must_")) {
            in.fail("this version does not know the key");
        }
        in.skip();
        if (roster_.ignored_key_.empty()) {
            roster_.ignored_key_ = key;
        }
    }

    // What depends on several members.
    bool check_members(json_reader& in) {
        const auto& members = roster_.members_;
        for (std::uint32_t before = 0; const auto& entry : members) {
            if (entry.number <= before) {
                return in.fail("the members are not in ascending order of their numbers");
            }
            before = entry.number;
        }
        if (!members.empty() && members.back().number > roster_.last_) {
            return in.fail("a member's number is above 'last'");
        }
        const auto name = [&](std::uint32_t at) -> const std::string& { return members[at].name; };
        const auto key = [&](std::uint32_t at) -> const public_key& { return members[at].key; };
        if (const auto twice = sort_by(roster_.by_name_, name); twice != nullptr) {
            return in.fail("two members have the name " + protocol::quoted(twice->name));
        }
        if (const auto twice = sort_by(roster_.by_key_, key); twice != nullptr) {
            return in.fail("two members have the key of " + protocol::quoted(twice->name));
        }
        return true;
    }

    // Returns a member that is equal to another one.
    template <class Projection>
    const member* sort_by(std::vector<std::uint32_t>& positions, Projection value) {
        positions.resize(roster_.members_.size());
        std::iota(positions.begin(), positions.end(), std::uint32_t{0});
        std::ranges::sort(positions, {}, value);
        const auto twice = std::ranges::adjacent_find(positions, {}, value);
        return twice == positions.end() ? nullptr : &roster_.members_[*twice];
    }

    roster& roster_;
    const roster* known_;
};

std::shared_ptr<const roster> roster::read(std::string_view line, const public_key& fleet, const roster* known) {
    signature made{};
    const auto content = open_line(line, made);
    if (!verify(fleet, signed_text_of(content), made)) {
        throw security_error{"the roster is not signed by the fleet's key"};
    }
    const std::shared_ptr<roster> result{new roster};
    roster_reader{*result, known}.read(content);
    if (result->fleet_ != fleet) {
        throw security_error{"the roster is of another fleet"};
    }
    result->line_ = line;
    return result;
}

public_key roster::named_fleet(std::string_view line) {
    signature made{};
    json_reader in{open_line(line, made)};
    in.begin_object();
    for (std::string_view key; in.next_key(key);) {
        if (key == "fleet") {
            public_key fleet{};
            if (read_key(in, fleet)) {
                return fleet;
            }
            in.inside_member("fleet");
            break;
        }
        in.skip();
    }
    throw security_error{"the roster names no fleet" + (in.ok() ? std::string{} : ": " + in.error())};
}

std::string roster::sign(std::string_view content, const signing_key& fleet) {
    const auto size = content_at + content.size() + line_end.size();
    if (size > max_roster_line) {
        throw security_error{"the roster would have " + std::to_string(size) + " bytes; it may have 1,000,000"};
    }
    std::string line{line_start};
    line.append(to_base64url(fleet.sign(signed_text_of(content)))).append(line_middle).append(content).append(line_end);
    return line;
}

std::string_view roster::content() const noexcept {
    const std::string_view line{line_};
    return line.substr(content_at, line.size() - content_at - line_end.size());
}

const member* roster::find(std::uint32_t number) const {
    const auto found = std::ranges::lower_bound(members_, number, {}, &member::number);
    return found != members_.end() && found->number == number ? &*found : nullptr;
}

const member* roster::find(std::string_view name) const {
    const auto found = std::ranges::lower_bound(by_name_, name, {},
                                                [&](std::uint32_t at) { return std::string_view{members_[at].name}; });
    return found != by_name_.end() && members_[*found].name == name ? &members_[*found] : nullptr;
}

const member* roster::find(const public_key& key) const {
    const auto found = std::ranges::lower_bound(
        by_key_, key, {}, [&](std::uint32_t at) -> const public_key& { return members_[at].key; });
    return found != by_key_.end() && members_[*found].key == key ? &members_[*found] : nullptr;
}

bool roster::has(const member& other) const {
    const auto* const found = find(other.number);
    return found != nullptr && found->is(other);
}

} // namespace cles::security
