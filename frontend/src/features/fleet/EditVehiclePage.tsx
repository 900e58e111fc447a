import { Button, Group } from "@mantine/core";
import { useState } from "react";
import { Link, Navigate, useNavigate, useParams } from "react-router";
import { useReadOnlyReason } from "../../api/access";
import { useDeleteVehicle, useEditVehicle } from "../../api/fleet";
import { reasonsByField, standingProblem } from "../../api/problems";
import { useCatalogue } from "../../api/queries";
import type { Catalogue, Vehicle } from "../../api/types";
import { useVehicles } from "../../api/vehicles";
import classes from "../../ui/Form.module.css";
import { FormPage } from "../../ui/FormPage";
import { ErrorNotice, FormErrorNotice, ReadOnlyNotice } from "../../ui/Notices";
import { useTitle } from "../../ui/useTitle";
import { AddressField, FurtherFields, furtherLabels, NameField, PLAIN_LABELS } from "./VehicleFields";

/** Name and settings of a disconnected vehicle; of any other its own page is shown, and of a deleted one the list. */
export function EditVehiclePage() {
  const vehicleId = Number(useParams()["vehicleId"]);
  const vehicles = useVehicles();
  const catalogue = useCatalogue();
  const vehicle = vehicles.data?.find(({ id }) => id === vehicleId);
  useTitle("Edit vehicle");
  if (vehicles.data && !vehicle) return <Navigate to="/vehicles" replace />;
  if (vehicle && !vehicle.actions.includes("configure")) return <Navigate to={`/vehicles/${vehicleId}`} replace />;
  return (
    <FormPage
      title={`Edit ${vehicle?.name ?? "vehicle"}`}
      error={vehicles.error ?? catalogue.error}
      isPending={vehicles.isPending || catalogue.isPending}
    >
      {vehicle && catalogue.data && <EditForm vehicle={vehicle} catalogue={catalogue.data} />}
    </FormPage>
  );
}

function EditForm({ vehicle, catalogue }: { vehicle: Vehicle; catalogue: Catalogue }) {
  const [{ version, name, options }, setForm] = useState(vehicle);
  const navigate = useNavigate();
  const edit = useEditVehicle(vehicle.id);
  const request = { version, name: name.trim(), options };
  const labels = { ...PLAIN_LABELS, ...furtherLabels(catalogue) };
  const problem = standingProblem(edit.error, edit.variables, request);
  const reasons = reasonsByField(problem, Object.keys(labels));
  const set = (change: Partial<Vehicle>): void => setForm((form) => ({ ...form, ...change }));
  return (
    <form
      noValidate
      className={classes["form"]}
      onSubmit={(event) => {
        event.preventDefault();
        edit.mutate(request, { onSuccess: () => void navigate(`/vehicles/${vehicle.id}`) });
      }}
    >
      <ReadOnlyNotice why={useReadOnlyReason(vehicle)} />
      <NameField value={name} error={reasons["name"]} onChange={(changed) => set({ name: changed })} />
      <AddressField
        value={options["address"]}
        error={reasons["options.address"]}
        onChange={(address) => set({ options: { ...options, address } })}
      />
      <FurtherFields
        catalogue={catalogue}
        options={options}
        reasons={reasons}
        onChange={(option, value) => set({ options: { ...options, [option]: value } })}
      />
      <FormErrorNotice error={problem} labels={labels} />
      <Group>
        <DeleteVehicle vehicle={vehicle} />
        <Button component={Link} to={`/vehicles/${vehicle.id}`} variant="default" ms="auto">
          Cancel
        </Button>
        <Button type="submit" loading={edit.isPending}>
          Save
        </Button>
      </Group>
    </form>
  );
}

function DeleteVehicle({ vehicle }: { vehicle: Vehicle }) {
  const navigate = useNavigate();
  const [isAsked, setAsked] = useState(false);
  const remove = useDeleteVehicle(vehicle, () => void navigate("/vehicles"));
  return (
    <>
      {isAsked ? (
        <Button color="red" loading={remove.isPending} onClick={() => remove.mutate()}>
          Delete with its gain history and commands
        </Button>
      ) : (
        <Button variant="default" onClick={() => setAsked(true)}>
          Delete vehicle
        </Button>
      )}
      <ErrorNotice error={remove.error} />
    </>
  );
}
