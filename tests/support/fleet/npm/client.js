// The client options of both programs. The library implements versions 1.1 and 2.0.0; the robot's messages say 2.1.0.
module.exports = (brokerUrl) => ({
  interfaceName: "uagv", transport: {brokerUrl, protocolVersion: "3.1.1"}, vdaVersion: "2.0.0",
  topicObjectValidation: {inbound: false},
});
