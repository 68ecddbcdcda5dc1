// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/shared_turns.hpp"
#include "port/stranger_places.hpp"
#include "security/fleet/fleet.hpp"

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace cles::security {

class link_admission;

/// What all links of a node share while they are admitted.
struct admission_terms {
    /// Bytes of a roster that anybody may send: what a link takes anyway while it is opened.
    static constexpr std::size_t short_roster = 16384;
    /// Bytes of all longer rosters that are arriving from unknown keys. Only what has arrived counts, so whoever wants
    /// to use them up has to send them.
    static constexpr std::size_t long_rosters = std::size_t{1} << 24U;
    using handshake_turns = core::shared_turns<std::string>;
    static constexpr handshake_turns::bounds usual_handshakes{.share = {.per_second = 1, .at_once = 4},
                                                              .shares = {.per_second = 512, .at_once = 1024},
                                                              .common = {.per_second = 128, .at_once = 256}};

    std::shared_ptr<security::fleet> fleet;
    std::string epoch; ///< of this node
    core::stranger_places<link_admission> rosters_of_strangers{};
    /// Handshakes with those that open links here, whose agreements and signatures take most of the time.
    handshake_turns handshakes{usual_handshakes};
};

/// What both ends of a new link exchange before any other line, once each has proved that it has its key
/// (docs/protocol_security.md, "Streams"): hello, the newer roster, welcome. Decides whether the other end is a member,
/// and which. Sans-I/O.
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
        busy,       ///< strangers use up what it needs
    };

    /// \param expected the name that the other end must have; empty: any
    /// \param host where the other end is, on which its share depends
    explicit link_admission(std::shared_ptr<admission_terms> terms, std::string expected = {},
                            std::string_view host = {});
    link_admission(const link_admission&) = delete;
    link_admission& operator=(const link_admission&) = delete;
    ~link_admission();

    /// The other end has opened this link, and sends the first bytes of its handshake. False: the link is refused.
    [[nodiscard]] bool take_handshake(time_point now);
    /// `displaced` is called when another link needs what this one holds: the link is refused, as the line says, and
    /// ends.
    void on_displaced(std::function<void(std::string_view line)> displaced) { displaced_ = std::move(displaced); }

    /// The other end has proved that it has this key. Appends the first line to `out`.
    void begin(const public_key& peer, std::string& out);
    /// Takes a line of the other end, without its LF, and appends what is to be sent to `out`. After `refused`, the
    /// link ends when that is sent.
    /// \pre it has begun, and is pending
    verdict on_line(std::string_view line, std::string& out);
    /// So much of the next line has arrived, and its end has not. As `on_line`.
    verdict on_part(std::size_t size, std::string& out);
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

    /// The other end is not admitted any more. Releases what other links may need.
    void give_up() noexcept { roster_place_.release(); }

  private:
    enum class stage : std::uint8_t { hello, roster, welcome, done };

    verdict on_hello(std::string_view body, std::string& out);
    verdict on_roster(std::string_view body, std::string& out);
    verdict on_welcome();
    verdict look_up(std::string& out);
    verdict refuse(reason r, std::string why);
    [[nodiscard]] const member* find_peer();
    [[nodiscard]] bool make_space_for_roster(std::size_t size);
    void displace();

    std::shared_ptr<admission_terms> terms_;
    std::string expected_;
    std::string source_; // what it shares with other links
    stage stage_ = stage::hello;
    public_key key_{};
    std::uint32_t stated_ = 0; // the version that this end has stated
    std::string name_;
    std::uint32_t number_ = 0;
    std::optional<std::uint32_t> own_number_; // nothing: this node was no member
    std::string epoch_;
    std::string why_;
    reason reason_ = reason::none;
    admission_terms::handshake_turns::turn handshake_ = admission_terms::handshake_turns::turn::refused;
    core::stranger_places<link_admission>::place roster_place_;
    std::function<void(std::string_view)> displaced_;
};

} // namespace cles::security
