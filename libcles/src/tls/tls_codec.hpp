// SPDX-License-Identifier: BSL-1.0
#pragma once

#include "protocol/line.hpp"
#include "security/link_admission.hpp"
#include "tls/tls_engine.hpp"
#include "transport/stream_codec.hpp"

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace cles::tls {

/// The codec of a `tls` link: it is open when the TLS handshake and the admission are complete.
class tls_codec final : public transport::stream_codec {
  public:
    /// Receives, for people, why a link was refused.
    using report_function = std::function<void(std::string_view)>;

    tls_codec(std::shared_ptr<const tls_context> shared, tls_engine::role as,
              std::shared_ptr<security::admission_terms> terms, std::string expected, report_function report,
              std::chrono::milliseconds time_to_open);

    std::span<char> prepare() override { return engine_.prepare(); }
    void commit(std::size_t count) override { engine_.commit(count); }
    status open(boost::system::error_code& why) override;
    [[nodiscard]] std::chrono::milliseconds time_to_open() const override { return time_to_open_; }
    void describe(identity& peer) const override { peer.name = admission_.name(); }
    [[nodiscard]] std::string_view epoch() const noexcept override { return admission_.epoch(); }
    void watch(std::function<void(boost::system::error_code)> broken) override;
    status decode(std::span<char> space, std::size_t& count, boost::system::error_code& why) override;
    void encode(std::string_view text, boost::system::error_code& why) override;
    void finish() override { engine_.finish(); }
    [[nodiscard]] std::string& encoded() noexcept override { return engine_.encrypted(); }
    [[nodiscard]] std::size_t buffered() const noexcept override;
    void shrink() override { engine_.shrink(); }

  private:
    [[nodiscard]] status admit(boost::system::error_code& why);
    [[nodiscard]] status take_line(std::string_view line, boost::system::error_code& why);

    std::shared_ptr<const tls_context> shared_;
    std::shared_ptr<security::admission_terms> terms_;
    report_function report_;
    std::chrono::milliseconds time_to_open_;
    tls_engine engine_;
    security::link_admission admission_;
    std::optional<protocol::line_buffer> lines_; // of the admission
    std::string rest_;                           // what followed them
    std::shared_ptr<void> observation_;          // of the roster
    bool shaken_ = false;
    bool removed_ = false;
};

} // namespace cles::tls
