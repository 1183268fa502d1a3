// Reads a recording with @mcap/core and decodes every message with the descriptors in it; prints counts and examples.
import fs from "node:fs/promises";
import { McapIndexedReader } from "@mcap/core";
import { FileHandleReadable } from "@mcap/nodejs";
import { loadDecompressHandlers } from "@mcap/support";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";

const handle = await fs.open(process.argv[2], "r");
const decompressHandlers = await loadDecompressHandlers();
const reader = await McapIndexedReader.Initialize({ readable: new FileHandleReadable(handle), decompressHandlers });
const types = new Map();
for (const [id, schema] of reader.schemasById) {
  const root = protobuf.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(schema.data));
  root.resolveAll();
  types.set(id, root.lookupType(schema.name));
}
const counts = {};
const examples = {};
for await (const message of reader.readMessages()) {
  const channel = reader.channelsById.get(message.channelId);
  const type = types.get(channel.schemaId);
  const value = type.decode(message.data);
  counts[channel.topic] = (counts[channel.topic] ?? 0) + 1;
  examples[channel.topic] ??= type.toObject(value, { longs: Number, enums: String, defaults: true });
}
await handle.close();
console.log(JSON.stringify({ counts, examples }));
