// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/link.hpp>

#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace cles::perf {

/// A link without a transport: lines to and from the service are passed by function calls. So the cost of a line is
/// measured without sockets, and without access to the library's internals.
class direct_link final : public link {
  public:
    explicit direct_link(std::string where);

    /// Delivers a line, like a read that returned this one line.
    void deliver(std::string_view line);
    /// What the service has written last.
    [[nodiscard]] const std::string& written() const noexcept { return written_; }

    void start(std::shared_ptr<link_events> owner) override { owner_ = std::move(owner); }
    std::string& output() override { return output_; }
    void flush() override;
    [[nodiscard]] std::size_t unsent() const noexcept override { return 0; }
    [[nodiscard]] std::uint64_t sent() const noexcept override { return sent_; }
    [[nodiscard]] std::uint64_t received() const noexcept override { return received_; }
    void pause(bool) override {}
    void finish() override { close(); }
    void close() override { owner_.reset(); }
    [[nodiscard]] const identity& peer() const noexcept override { return peer_; }

  private:
    identity peer_;
    std::shared_ptr<link_events> owner_;
    std::string output_;
    std::string written_;
    std::uint64_t sent_ = 0;
    std::uint64_t received_ = 0;
};

/// Creates direct links: a service listens at `url`, or has its peer there.
class direct_exchange {
  public:
    static constexpr const char* url = "direct://here:1";

    /// Registers the scheme "direct". \pre there is no other one, and only one service of each kind
    direct_exchange();

    /// A link into the service that listens.
    [[nodiscard]] std::shared_ptr<direct_link> call() const;
    /// The link that a service has made to its peer; null before.
    [[nodiscard]] std::shared_ptr<direct_link> dialled() const { return places_->dialled; }

    struct places {
        std::function<void(link_ptr)> on_link;
        std::shared_ptr<direct_link> dialled;
    };

  private:
    std::shared_ptr<places> places_;
};

} // namespace cles::perf
