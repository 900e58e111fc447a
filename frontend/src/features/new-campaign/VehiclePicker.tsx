import { Anchor, Button, Input } from "@mantine/core";
import type { ReactNode } from "react";
import { Link } from "react-router";
import { useCatalogue } from "../../api/queries";
import type { Vehicle, VehicleKindInfo } from "../../api/types";
import { VehicleBadge } from "../../ui/Badges";
import { autopilotTitle } from "../fleet/fleet";
import { VehicleStateBadge } from "../fleet/VehicleStateBadge";
import classes from "./NewCampaign.module.css";

interface Props {
  kinds: readonly VehicleKindInfo[];
  registered: readonly Vehicle[];
  /** Registered vehicles of other experiments; selecting one changes the experiment. */
  others: readonly Vehicle[];
  kind: string;
  vehicleId: number | null;
  error: string | undefined;
  onKind: (kind: string) => void;
  onVehicle: (vehicle: Vehicle) => void;
}

/** Selection of a registered vehicle or a shared simulation. */
export function VehiclePicker({ kinds, registered, others, kind, vehicleId, error, onKind, onVehicle }: Props) {
  const { data: catalogue } = useCatalogue();
  return (
    <div>
      <Input.Wrapper size="md" label="Vehicle" labelElement="div" error={error}>
        <div role="radiogroup" aria-label="Vehicle" className={classes["cards"]}>
          {registered.map((vehicle) => (
            <VehicleOption
              key={vehicle.id}
              isReal={vehicle.is_real}
              checked={vehicle.id === vehicleId}
              name={vehicle.name}
              line={autopilotTitle(catalogue, vehicle)}
              onChoose={() => onVehicle(vehicle)}
            >
              <VehicleStateBadge vehicle={vehicle} />
            </VehicleOption>
          ))}
          {kinds.map(({ name, title, line, is_real }) => (
            <VehicleOption
              key={name}
              isReal={is_real}
              checked={vehicleId === null && name === kind}
              name={title}
              line={line}
              onChoose={() => onKind(name)}
            />
          ))}
        </div>
      </Input.Wrapper>
      <div className={classes["more"]}>
        {others.length > 0 && <span>Vehicles that fly another experiment (choosing one changes it):</span>}
        {others.map((vehicle) => (
          <Button key={vehicle.id} variant="default" onClick={() => onVehicle(vehicle)}>
            {vehicle.name}
          </Button>
        ))}
        <Anchor component={Link} to="/vehicles/new">
          Register a vehicle
        </Anchor>
      </div>
    </div>
  );
}

interface OptionProps {
  isReal: boolean;
  checked: boolean;
  name: string;
  line: string;
  onChoose: () => void;
  children?: ReactNode;
}

function VehicleOption({ isReal, checked, name, line, onChoose, children }: OptionProps) {
  return (
    <label className={classes["card"]}>
      <span className={classes["top"]}>
        <VehicleBadge isReal={isReal} />
        <input type="radio" name="vehicle" checked={checked} onChange={onChoose} />
      </span>
      <strong>{name}</strong>
      <span className={classes["line"]}>{line}</span>
      {children}
    </label>
  );
}
