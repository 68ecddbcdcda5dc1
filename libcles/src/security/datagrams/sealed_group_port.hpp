// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "port/group_port.hpp"
#include "security/datagrams/sealed_datagrams.hpp"

#include <boost/unordered/unordered_flat_set.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace cles::security {

/// A node's endpoint in the multicast group of a secured fleet (docs/protocol_security.md, "In the multicast group"):
/// seals what it sends by another port, and delivers what it can open, with the sender. A sender of which it does not
/// know the salt is contacted, and then asked to announce itself. A member that has an old roster gets the last
/// announcement of this node in a session, since it can open none in the group.
class sealed_group_port final : public core::group_port, private core::group_listener, private datagram_socket {
  public:
    /// A member did not answer, or has a newer roster; the endpoints are those that it has announced last, with the
    /// address that it sends from in place of an unspecified one.
    using unanswered = std::function<void(std::uint32_t member, const std::vector<std::string>& endpoints)>;

    sealed_group_port(std::shared_ptr<sealed_datagrams> by, std::shared_ptr<core::group_port> port, unanswered report);
    ~sealed_group_port() override;

    void start(core::group_listener& owner) override;
    core::datagrams_done send(core::datagram_list all) override;
    void send_to(const core::group_source&, std::string_view) override {} // all its datagrams are sealed for a session
    void receive_own() override {}                                        // it always does
    [[nodiscard]] std::size_t unsent() const noexcept override { return port_->unsent(); }
    void close() override;
    [[nodiscard]] const core::group_source& source() const noexcept override { return port_->source(); }

  private:
    // group_listener
    void on_datagram(const core::group_datagram& datagram) override;
    void on_writable() override;
    // datagram_socket
    void send_sealed(const datagram_path& to, bytes_view datagram) override;
    void on_opened(const datagram_source&, std::uint32_t, std::string_view) override {} // only announcements are sent
    void on_announcement(const datagram_source& from, std::string_view line) override;
    void on_outdated(const datagram_source& outdated) override;
    void on_established(const datagram_source& with, std::uint32_t epoch) override;
    void on_gave_up(const datagram_source& with, bool lost) override;

    [[nodiscard]] datagram_path path_of(const core::group_source& from) const noexcept {
        return datagram_path::v4(from.address, from.port, number_);
    }
    void on_group(const core::group_datagram& datagram);
    void note_unknown(std::uint32_t member, std::string_view line, const core::group_source& from);
    void on_roster();

    std::shared_ptr<sealed_datagrams> all_;
    std::shared_ptr<core::group_port> port_;
    unanswered report_;
    std::uint32_t number_;
    core::group_listener* owner_ = nullptr; // null: closed
    std::string line_;                      // scratch space for what was opened
    std::string sealed_;
    std::vector<std::uint16_t> sizes_;
    std::map<std::uint32_t, std::vector<std::string>> unknown_; // announced endpoints of members with unknown salts
    boost::unordered_flat_set<std::uint32_t> received_;         // members of which lines have been opened
    std::string announcement_start_;
    std::string announcement_;              // the last one of this node
    std::vector<datagram_source> outdated_; // members that get it once there is a session
    bool is_behind_ = false;                // a member has said that this node's roster is old
    std::shared_ptr<void> observation_;
};

} // namespace cles::security
