// SPDX-License-Identifier: BSL-1.0
#include "gateway/serve/client_stream.hpp"

#include "system/whole_file.hpp"

#include <boost/asio/post.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/ssl/stream.hpp>
#include <boost/asio/write.hpp>

#include <stdexcept>
#include <string>
#include <utility>

namespace gateway {
namespace asio = boost::asio;
using boost::system::error_code;

namespace {

class plain_client final : public client_stream {
  public:
    explicit plain_client(asio::ip::tcp::socket socket) : socket_(std::move(socket)) {}

    void handshake(done then) override {
        asio::post(socket_.get_executor(), [then = std::move(then)] { then({}, 0); });
    }
    void read(asio::mutable_buffer into, done then) override { socket_.async_read_some(into, std::move(then)); }
    void write(asio::const_buffer from, done then) override { asio::async_write(socket_, from, std::move(then)); }
    [[nodiscard]] asio::ip::tcp::socket& socket() override { return socket_; }

  private:
    asio::ip::tcp::socket socket_;
};

class tls_client final : public client_stream {
  public:
    tls_client(asio::ip::tcp::socket socket, asio::ssl::context& with) : stream_(std::move(socket), with) {}

    void handshake(done then) override {
        stream_.async_handshake(asio::ssl::stream_base::server,
                                [then = std::move(then)](error_code code) { then(code, 0); });
    }
    void read(asio::mutable_buffer into, done then) override { stream_.async_read_some(into, std::move(then)); }
    void write(asio::const_buffer from, done then) override { asio::async_write(stream_, from, std::move(then)); }
    [[nodiscard]] asio::ip::tcp::socket& socket() override { return stream_.next_layer(); }

  private:
    asio::ssl::stream<asio::ip::tcp::socket> stream_;
};

} // namespace

void client_stream::shutdown() {
    error_code ignored;
    socket().shutdown(asio::ip::tcp::socket::shutdown_send, ignored);
}

void client_stream::close() {
    error_code ignored;
    socket().close(ignored);
}

void client_stream::keep_little() {
    constexpr int bytes = 32'768; // the system doubles it
    error_code ignored;
    socket().set_option(asio::socket_base::send_buffer_size{bytes}, ignored);
}

std::unique_ptr<client_stream> plain_stream(asio::ip::tcp::socket socket) {
    return std::make_unique<plain_client>(std::move(socket));
}

std::unique_ptr<client_stream> tls_stream(asio::ip::tcp::socket socket, asio::ssl::context& with) {
    return std::make_unique<tls_client>(std::move(socket), with);
}

std::shared_ptr<asio::ssl::context> tls_context(const std::string& certificate, const std::string& key) {
    using context = asio::ssl::context;
    auto made = std::make_shared<context>(context::tls_server);
    error_code code;
    made->set_options(context::default_workarounds | context::no_sslv2 | context::no_sslv3 | context::no_tlsv1 |
                          context::no_tlsv1_1,
                      code);
    const auto check = [](const std::string& path, const auto& failed) {
        if (failed) {
            throw std::runtime_error(path + ": " + failed.message());
        }
    };
    std::string text;
    check("TLS", code);
    check(certificate, tool::read_file(certificate, text));
    made->use_certificate_chain(asio::buffer(text), code);
    check(certificate, code);
    check(key, tool::read_file(key, text));
    made->use_private_key(asio::buffer(text), context::pem, code);
    check(key, code);
    return made;
}

} // namespace gateway
