// SPDX-License-Identifier: BSL-1.0
#include "tls/sealed_udp.hpp"

#include "tls/tls_error.hpp"
#include "tls/udp_codec.hpp"
#include "transport/ip_host.hpp"
#include "transport/udp.hpp"

#include <string>
#include <utility>

namespace cles::tls {
namespace asio = boost::asio;

namespace {

class sealed_udp final : public link_transport {
  public:
    sealed_udp(std::shared_ptr<security::fleet> fleet, std::shared_ptr<security::sealed_datagrams> all)
        : fleet_(std::move(fleet)), all_(std::move(all)) {}

    [[nodiscard]] bool authenticates() const override { return true; }
    [[nodiscard]] bool is_exposed(const url& where) const override { return transport::is_beyond_loopback(where); }

    std::unique_ptr<acceptor> listen(const asio::any_io_executor& executor, const url& where, const limits&) override {
        return transport::listen_udp(executor, where, std::make_unique<udp_codec>(fleet_, all_));
    }

    std::function<void()> dial(const asio::any_io_executor& executor, const url& where, const limits& bounds,
                               dial_callback done) override {
        return dial_node(executor, where, {}, bounds, std::move(done));
    }

    std::function<void()> dial_node(const asio::any_io_executor& executor, const url& where, std::string_view name,
                                    const limits& bounds, dial_callback done) override {
        return transport::dial_udp(
            executor, where, bounds, std::move(done),
            [fleet = fleet_, all = all_, expected = std::string{name}](boost::system::error_code& code) {
                return member_of(fleet, all, expected, code);
            });
    }

  private:
    static transport::sealed_peer member_of(const std::shared_ptr<security::fleet>& fleet,
                                            const std::shared_ptr<security::sealed_datagrams>& all,
                                            const std::string& name, boost::system::error_code& code) {
        const auto* const found = fleet->in_force().find(name);
        if (found == nullptr) {
            code = name.empty() ? tls_errc::needs_name : tls_errc::unknown_name;
            return {};
        }
        return {.codec = std::make_unique<udp_codec>(fleet, all), .member = found->number, .name = name};
    }

    std::shared_ptr<security::fleet> fleet_;
    std::shared_ptr<security::sealed_datagrams> all_;
};

} // namespace

std::unique_ptr<link_transport> make_sealed_udp(std::shared_ptr<security::fleet> fleet,
                                                std::shared_ptr<security::sealed_datagrams> all) {
    return std::make_unique<sealed_udp>(std::move(fleet), std::move(all));
}

} // namespace cles::tls
