// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "node/node_state.hpp"
#include "port/node_security.hpp"
#include "transport/datagram_codec.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace cles::simulation {

/// The public key of a process.
using link_key = std::array<std::uint8_t, 32>;

/// What both ends of a new stream exchange before any other line. The simulated stream carries it unencrypted.
class stream_gate {
  public:
    enum class verdict : std::uint8_t { pending, admitted, refused };

    stream_gate() = default;
    stream_gate(const stream_gate&) = delete;
    stream_gate& operator=(const stream_gate&) = delete;
    virtual ~stream_gate() = default;

    /// The other end has this key, as the TLS handshake would have shown. Appends the first lines to `out`.
    virtual void begin(const link_key& peer, std::string& out) = 0;
    virtual verdict on_line(std::string_view line, std::string& out) = 0;
    [[nodiscard]] virtual std::size_t max_line() const = 0;

    // Once it has admitted the other end.
    [[nodiscard]] virtual const std::string& name() const = 0;
    [[nodiscard]] virtual std::string_view epoch() const = 0;
    /// `removed` is called when one of the ends is no longer a member.
    virtual void watch(std::function<void()> removed) = 0;
};

/// What a simulated process uses on its links with security. An interface, so that the network does without it.
class link_security {
  public:
    link_security() = default;
    link_security(const link_security&) = delete;
    link_security& operator=(const link_security&) = delete;

    /// What a certificate shows to the other end.
    [[nodiscard]] virtual const link_key& own_key() const = 0;
    /// \param expected the name that the other end must have; empty: any
    [[nodiscard]] virtual std::unique_ptr<stream_gate> make_gate(std::string_view expected) = 0;
    [[nodiscard]] virtual std::unique_ptr<transport::datagram_codec> make_codec() = 0;
    /// The number of a member; 0 if there is none of that name.
    [[nodiscard]] virtual std::uint32_t number_of(std::string_view name) const = 0;

  protected:
    ~link_security() = default;
};

/// The security of a simulated node.
class simulated_security : public link_security {
  public:
    virtual ~simulated_security() = default;
    /// What the library's node uses.
    [[nodiscard]] virtual core::node_security& of_node() = 0;
    /// What the node says with security.
    using protocol_maker = std::unique_ptr<core::security_protocol> (*)(core::node_state& host);
    [[nodiscard]] virtual protocol_maker maker_of_protocol() const = 0;
};

} // namespace cles::simulation
