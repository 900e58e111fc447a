import { Anchor } from "@mantine/core";
import { useState } from "react";
import { codeOf, type System } from "../../api/system";
import { Panel } from "../../ui/Panel";
import { SelectField } from "../../ui/SelectField";
import classes from "./SettingsPage.module.css";

/** How another device opens this dashboard, and what it means that it can. */
export function RemoteAccess({ system }: { system: System }) {
  return (
    <Panel title="Open on the tablet">
      <div className={classes["stack"]}>
        {system.addresses.length > 0 ? <Reached system={system} /> : <Alone system={system} />}
      </div>
    </Panel>
  );
}

function Reached({ system: { addresses, exposes, host, in_container } }: { system: System }) {
  const urls = addresses.map(({ url }) => url);
  const [chosen, setChosen] = useState(urls[0] ?? "");
  return (
    <>
      {addresses.length > 1 && (
        <SelectField
          label="Network"
          value={chosen}
          onChange={setChosen}
          data={addresses.map(({ url, interface: name }) => ({ value: url, label: `${name}: ${url}` }))}
        />
      )}
      <div className={classes["code"]}>
        <img src={codeOf(chosen)} alt={`QR code of ${chosen}`} width={220} height={220} />
        <p className={classes["quiet"]}>
          Point the tablet’s camera at it, or type
          <Anchor href={chosen} className={classes["address"] ?? ""}>
            {chosen}
          </Anchor>
          Both devices have to be in the same network. It may look at everything then; to change campaigns and fly
          simulations from it, open the link that <code>gainline unlock</code> prints here.
        </p>
      </div>
      {in_container && (
        <p className={classes["quiet"]}>
          Gainline runs in a container, and this is the container’s address. If the tablet does not find it, use the
          computer’s own address and the port that the container publishes.
        </p>
      )}
      <p className={classes["warning"]}>
        <strong>It listens on {host}</strong>, so {exposes}
      </p>
    </>
  );
}

function Alone({ system: { exposes, host, is_exposed } }: { system: System }) {
  if (is_exposed) {
    return <p className={classes["quiet"]}>It listens on {host}, but this computer is in no network at present.</p>;
  }
  return (
    <>
      <p className={classes["quiet"]}>
        Only this computer reaches the dashboard now: it listens on {host}. To open it on a tablet in the same network,
        stop it and start it with
      </p>
      <code className={classes["command"]}>gainline serve --host 0.0.0.0</code>
      <p className={classes["quiet"]}>(from a checkout: ./dev up --host 0.0.0.0). Its address then stands here.</p>
      <p className={classes["warning"]}>
        <strong>What that opens:</strong> {exposes}
      </p>
    </>
  );
}
