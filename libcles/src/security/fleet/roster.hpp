// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/security/member_rights.hpp>

#include "security/keys/keys.hpp"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::security {

inline constexpr std::size_t max_roster_line = 1'000'000;
inline constexpr std::size_t max_members = 4096;
inline constexpr std::uint32_t max_member_number = 0xFF'FFFF;
inline constexpr std::uint32_t max_version = 0xFFFF'FFFF;
inline constexpr std::uint32_t max_generation = 0xFFFF'FFFE;

/// A node of the fleet, as the roster lists it.
struct member : member_rights {
    std::uint32_t number = 0; ///< 1 to 2^24-1, never given again
    std::string name{};
    public_key key{};
    agreement_key agreement{}; ///< the X25519 form of `key`
    std::string group_keys{};  ///< sealed for this member, as written

    [[nodiscard]] const member_rights& rights() const noexcept { return *this; }

    /// Whether it is the same member, whatever its rights.
    [[nodiscard]] bool is(const member& other) const noexcept {
        return number == other.number && name == other.name && key == other.key;
    }
};

/// A roster (docs/protocol_security.md, "The roster"): the members of a fleet, signed by the fleet's key. Immutable.
class roster {
  public:
    /// Reads a roster line, after it has verified the signature.
    /// \param known a roster that was read before. Keys in it are not checked again, which takes most of the time.
    /// \throws security_error
    static std::shared_ptr<const roster> read(std::string_view line, const public_key& fleet,
                                              const roster* known = nullptr);
    /// The fleet's key that an unverified line names; for files that introduce a fleet. \throws security_error
    static public_key named_fleet(std::string_view line);
    /// The line of a roster with this content. \throws security_error if it is longer than permitted
    static std::string sign(std::string_view content, const signing_key& fleet);

    [[nodiscard]] const std::string& line() const noexcept { return line_; }
    /// The part of the line that is signed. Two rosters with the same content do not differ.
    [[nodiscard]] std::string_view content() const noexcept;
    [[nodiscard]] const public_key& fleet() const noexcept { return fleet_; }
    [[nodiscard]] std::uint32_t version() const noexcept { return version_; }
    [[nodiscard]] std::uint32_t last() const noexcept { return last_; }
    [[nodiscard]] std::uint32_t generation() const noexcept { return generation_; }
    [[nodiscard]] std::uint32_t oldest() const noexcept { return oldest_; }
    /// By ascending number.
    [[nodiscard]] const std::vector<member>& members() const noexcept { return members_; }
    [[nodiscard]] const member* find(std::uint32_t number) const;
    [[nodiscard]] const member* find(std::string_view name) const;
    [[nodiscard]] const member* find(const public_key& key) const;
    /// Whether it lists the same member, whatever its rights.
    [[nodiscard]] bool has(const member& other) const;
    /// The group keys, sealed for the fleet's key, as written.
    [[nodiscard]] const std::string& authority_keys() const noexcept { return authority_keys_; }
    /// A key of the roster or of a member that this version ignores; empty if there is none.
    [[nodiscard]] const std::string& ignored_key() const noexcept { return ignored_key_; }

  private:
    friend class roster_reader;
    roster() = default;

    std::string line_;
    public_key fleet_{};
    std::uint32_t version_ = 0;
    std::uint32_t last_ = 0;
    std::uint32_t generation_ = 0;
    std::uint32_t oldest_ = 0;
    std::string authority_keys_;
    std::string ignored_key_;
    std::vector<member> members_;
    std::vector<std::uint32_t> by_name_; // positions in members_
    std::vector<std::uint32_t> by_key_;
};

} // namespace cles::security
