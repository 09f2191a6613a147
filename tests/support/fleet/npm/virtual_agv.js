// The virtual AGV of vda-5050-lib at the node "start": node virtual_agv.js URL MANUFACTURER SERIAL. Ends with its input.
const {AgvController, VirtualAgvAdapter} = require("vda-5050-lib");

const [url, manufacturer, serialNumber] = process.argv.slice(2);

(async () => {
  const client = {
    interfaceName: "uagv", transport: {brokerUrl: url, protocolVersion: "3.1.1"}, vdaVersion: "2.0.0",
    topicObjectValidation: {inbound: false},
  };
  const agv = new AgvController({manufacturer, serialNumber}, client, {agvAdapterType: VirtualAgvAdapter, publishStateInterval: 500}, {
    initialPosition: {mapId: "yard", x: 1.0, y: 2.0, theta: 0.0, lastNodeId: "start"}, vehicleSpeed: 5.0,
  });
  await agv.start();
  console.log("ready");
  process.stdin.on("end", () => process.exit(0)).resume();
})();
