// SPDX-License-Identifier: BSL-1.0
#pragma once

#include <cles/line_link.hpp>
#include <cles/link.hpp>

#include "security/secured_services.hpp"
#include "tls/tls_transport.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace cles::security::test {

/// A member that speaks without the library, such as one that forwards and alters.
class raw_member final : public link_events, public std::enable_shared_from_this<raw_member> {
  public:
    static std::shared_ptr<raw_member> connect(boost::asio::io_context& io, const secured_fleet& fleet,
                                               const std::string& name, const service& to) {
        auto made = std::make_shared<raw_member>(io);
        auto own = security::key_directory{fleet.directory_of(name)}.read_node();
        made->transport_ = tls::make_tls_transport(
            {.fleet = std::make_shared<security::fleet>(own.own.name, std::move(own.own.key), std::move(own.newest)),
             .epoch = "0000beef"});
        made->transport_->dial(io.get_executor(), parse_url(to.endpoints().front()), {},
                               [made](boost::system::error_code code, link_ptr link) {
                                   BOOST_REQUIRE(!code);
                                   made->link_ = std::move(link);
                                   made->link_->start(made);
                               });
        cles::test::run_until(io, [&] { return made->link_ != nullptr; });
        return made;
    }
    explicit raw_member(boost::asio::io_context& io) : io_(io) {}

    /// The reply to a request with the id 7.
    std::string ask(const std::string& line) {
        replies_.clear();
        link_->output().append(line + "\n");
        link_->flush();
        cles::test::run_until(io_, [&] { return !replies_.empty(); });
        return replies_.front();
    }
    void close() {
        link_->close();
        link_.reset();
    }

    void on_line(std::string_view line) override {
        if (line.starts_with("id=7 ")) {
            replies_.emplace_back(line.substr(5));
        }
    }
    void on_overlong(std::string_view) override {}
    void on_batch() override {}
    void on_end() override {}
    void on_lost(boost::system::error_code) override {}
    void on_writable() override {}

  private:
    boost::asio::io_context& io_;
    std::unique_ptr<link_transport> transport_;
    link_ptr link_;
    std::vector<std::string> replies_;
};

} // namespace cles::security::test
