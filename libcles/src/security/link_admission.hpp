// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "security/fleet/fleet.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace cles::security {

/// What all links of a node share while they are admitted.
struct admission_terms {
    /// Rosters that may arrive from unknown keys at a time: each takes up to a megabyte.
    static constexpr std::size_t max_rosters_of_strangers = 16;

    std::shared_ptr<security::fleet> fleet;
    std::string epoch; ///< of this node
    std::size_t rosters_of_strangers = 0;
};

/// What both ends of a new link exchange before any other line, once each has proved that it has its key
/// (docs/security.md, "Streams"): hello, the newer roster, welcome. Decides whether the other end is a member, and
/// which. Sans-I/O.
class link_admission {
  public:
    enum class verdict : std::uint8_t { pending, admitted, refused };
    enum class reason : std::uint8_t {
        none,
        protocol,   ///< the other end sent something else
        not_member, ///< its key is not in the roster
        removed,    ///< nor is it, but it was in an earlier one
        other_name, ///< it is another member than expected
        by_peer,    ///< it refused this end
        busy,       ///< too many rosters arrive at the same time
    };

    /// \param expected the name that the other end must have; empty: any
    explicit link_admission(std::shared_ptr<admission_terms> terms, std::string expected = {});
    link_admission(const link_admission&) = delete;
    link_admission& operator=(const link_admission&) = delete;
    ~link_admission();

    /// The other end has proved that it has this key. Appends the first line to `out`.
    void begin(const public_key& peer, std::string& out);
    /// Takes a line of the other end, without its LF, and appends what is to be sent to `out`. After `refused`, the
    /// link ends when that is sent.
    /// \pre it has begun, and is pending
    verdict on_line(std::string_view line, std::string& out);
    /// The maximum size of the next line. A longer one ends the link.
    [[nodiscard]] std::size_t max_line() const noexcept;

    /// The key of the other end.
    [[nodiscard]] const public_key& key() const noexcept { return key_; }
    /// For people.
    [[nodiscard]] const std::string& why() const noexcept { return why_; }
    [[nodiscard]] reason refused_for() const noexcept { return reason_; }

    // Once it is admitted.
    /// The other end's name.
    [[nodiscard]] const std::string& name() const noexcept { return name_; }
    [[nodiscard]] std::uint32_t number() const noexcept { return number_; }
    /// As it has stated it: eight hexadecimal digits.
    [[nodiscard]] const std::string& epoch() const noexcept { return epoch_; }
    /// Whether both ends are still the members that they were.
    [[nodiscard]] bool is_in_force() const;

  private:
    enum class stage : std::uint8_t { hello, roster, welcome, done };

    verdict on_hello(std::string_view body, std::string& out);
    verdict on_roster(std::string_view body, std::string& out);
    verdict on_welcome();
    verdict look_up(std::string& out);
    verdict refuse(reason r, std::string why);
    [[nodiscard]] const member* find_peer();
    void release_roster() noexcept;

    std::shared_ptr<admission_terms> terms_;
    std::string expected_;
    stage stage_ = stage::hello;
    public_key key_{};
    std::uint32_t stated_ = 0; // the version that this end has stated
    std::string name_;
    std::uint32_t number_ = 0;
    std::optional<std::uint32_t> own_number_; // nothing: this node was no member
    std::string epoch_;
    std::string why_;
    reason reason_ = reason::none;
    bool counted_ = false; // in `rosters_of_strangers`
};

} // namespace cles::security
