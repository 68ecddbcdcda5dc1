// SPDX-License-Identifier: BSL-1.0
#include "tls/tls_transport.hpp"

#include "security/link_admission.hpp"
#include "tls/tls_codec.hpp"
#include "tls/tls_context.hpp"
#include "transport/ip_host.hpp"
#include "transport/tcp.hpp"

#include <utility>

namespace cles::tls {
namespace asio = boost::asio;

namespace {

class tls_transport final : public link_transport {
  public:
    explicit tls_transport(tls_options options)
        : context_(std::make_shared<const tls_context>(options.fleet->own_key())),
          terms_(std::make_shared<security::admission_terms>()), report_(std::move(options.report)),
          time_to_open_(options.time_to_open) {
        terms_->fleet = std::move(options.fleet);
        terms_->epoch = std::move(options.epoch);
    }

    [[nodiscard]] bool authenticates() const override { return true; }
    [[nodiscard]] bool is_exposed(const url& where) const override { return transport::is_beyond_loopback(where); }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where,
                                     const limits& bounds) override {
        return transport::listen_tcp(executor, where, bounds, codecs(tls_engine::role::server, {}));
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        return dial_node(executor, where, {}, bounds, std::move(done));
    }

    std::function<void()> dial_node(const asio::any_io_executor& executor, const url& where, std::string_view name,
                                    const limits& bounds, dial_callback done) override {
        return transport::dial_tcp(executor, where, bounds, std::move(done), codecs(tls_engine::role::client, name));
    }

  private:
    [[nodiscard]] transport::codec_maker codecs(tls_engine::role as, std::string_view expected) const {
        return [context = context_, terms = terms_, report = report_, time = time_to_open_, as,
                expected = std::string{expected}] {
            return std::make_unique<tls_codec>(context, as, terms, expected, report, time);
        };
    }

    std::shared_ptr<const tls_context> context_;
    std::shared_ptr<security::admission_terms> terms_;
    tls_codec::report_function report_;
    std::chrono::milliseconds time_to_open_;
};

} // namespace

std::unique_ptr<link_transport> make_tls_transport(tls_options options) {
    return std::make_unique<tls_transport>(std::move(options));
}

} // namespace cles::tls
